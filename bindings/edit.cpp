#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "gslts/edit/inherit.hpp"
#include "gslts/edit/nearest.hpp"
#include "gslts/edit/sightings.hpp"
#include "gslts/edit/thin.hpp"
#include "gslts/edit/votes.hpp"
#include "map_arrays.hpp"

namespace gslts::python {
namespace {

using edit::DepthRule;
using edit::DepthView;
using edit::Sightings;
using edit::VoteRule;
using edit::Votes;
using edit::VotingView;

using Counts = py::typing::Tuple<py::array_t<std::int32_t>, py::array_t<std::int32_t>>;
using Images = std::vector<py::array>;

Counts counts_of(Array<std::int32_t>&& first, Array<std::int32_t>&& second) {
  const auto size = static_cast<py::ssize_t>(first.size());
  return py::make_tuple(to_numpy(std::move(first), {size}), to_numpy(std::move(second), {size}));
}

/// @throws std::invalid_argument  if there is not one image a camera.
void require_one_each(const char* name, const Images& images, const std::vector<Camera>& cameras) {
  if (images.size() == cameras.size()) return;
  throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(cameras.size()) +
                              ", one a camera, got " + std::to_string(images.size()));
}

Counts votes_of(const GaussianView<float>& gaussians, const std::vector<Camera>& cameras,
                const Images& masks, const std::optional<Images>& rendered, const VoteRule& rule) {
  require_one_each("masks", masks, cameras);
  if (rendered) require_one_each("rendered", *rendered, cameras);
  std::vector<VotingView> views;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const std::vector<py::ssize_t> shape = {cameras[k].height, cameras[k].width};
    const bool* mask = require_array<bool>(masks[k], "masks", shape);
    views.push_back({cameras[k], reinterpret_cast<const std::uint8_t*>(mask),
                     rendered ? require_array<float>((*rendered)[k], "rendered", shape) : nullptr});
  }
  Votes votes = [&] {
    const py::gil_scoped_release release;
    return edit::votes_of(gaussians, views, rule);
  }();
  return counts_of(std::move(votes.votes), std::move(votes.views));
}

Counts sightings_of(const GaussianView<float>& gaussians, const std::vector<Camera>& cameras,
                    const Images& measured, const DepthRule& rule) {
  require_one_each("measured", measured, cameras);
  std::vector<DepthView> views;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    views.push_back({cameras[k], require_array<float>(measured[k], "measured",
                                                      {cameras[k].height, cameras[k].width})});
  }
  Sightings sightings = [&] {
    const py::gil_scoped_release release;
    return edit::sightings_of(gaussians, views, rule);
  }();
  return counts_of(std::move(sightings.on), std::move(sightings.through));
}

py::typing::Tuple<py::array_t<std::uint32_t>, py::array_t<float>> nearest_gaussians(
    const GaussianView<float>& gaussians, const py::array& points, int k) {
  const float* places = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  edit::Neighbours found = [&] {
    const py::gil_scoped_release release;
    return edit::nearest_gaussians(gaussians, places, std::size_t(count), k);
  }();
  return py::make_tuple(to_numpy(std::move(found.rows), {count, found.k}),
                        to_numpy(std::move(found.distances_m), {count, found.k}));
}

py::array_t<std::uint32_t> thinned(const py::array& points, const py::array& spacing_m) {
  const float* places = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  const float* spacing = require_array<float>(spacing_m, "spacing_m", {count});
  Array<std::uint32_t> stay = [&] {
    const py::gil_scoped_release release;
    return edit::thinned(places, spacing, std::size_t(count));
  }();
  const auto size = static_cast<py::ssize_t>(stay.size());
  return to_numpy(std::move(stay), {size});
}

MapArrays inherited(const GaussianView<float>& gaussians, const py::array& points,
                    const py::array& rows, std::uint64_t first_id) {
  const float* places = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  const auto* parents = require_array<std::uint32_t>(rows, "rows", {count});
  return arrays_of(edit::inherited(gaussians, places, parents, std::size_t(count), first_id));
}

void define_rules(py::module_& m) {
  const VoteRule vote;
  py::class_<VoteRule>(m, "VoteRule", R"(How far behind the surface that the map shows a Gaussian
still belongs to it.

Args:
    behind_m: At the camera, m,
    behind_share: and by so much of the depth more.)")
      .def(py::init([](double behind_m, double behind_share) {
             return VoteRule{behind_m, behind_share};
           }),
           py::kw_only(), py::arg("behind_m") = vote.behind_m,
           py::arg("behind_share") = vote.behind_share)
      .def_readonly("behind_m", &VoteRule::behind_m)
      .def_readonly("behind_share", &VoteRule::behind_share);

  const DepthRule depth;
  py::class_<DepthRule>(m, "DepthRule", R"(Depths that differ by no more are the same.

Args:
    margin_m: At the camera, m,
    margin_share: and by so much of the depth more.)")
      .def(py::init([](double margin_m, double margin_share) {
             return DepthRule{margin_m, margin_share};
           }),
           py::kw_only(), py::arg("margin_m") = depth.margin_m,
           py::arg("margin_share") = depth.margin_share)
      .def_readonly("margin_m", &DepthRule::margin_m)
      .def_readonly("margin_share", &DepthRule::margin_share);
}

}  // namespace

void define_edit(py::module_ m) {
  define_rules(m);
  m.def("votes_of", &votes_of, py::arg("gaussians"), py::arg("cameras"), py::arg("masks"),
        py::arg("rendered"), py::arg("rule"),
        R"(Counts the views in whose mask the centre of each of N Gaussians is seen.

Args:
    gaussians: Of a map.
    cameras: Of the views.
    masks: [H,W] bool of each, True where the image shows what is voted for.
    rendered: [H,W] float32 of each, depth of the map from there, z, m, 0 where nothing is: what is
        hidden then does not vote. None: it votes too, as in the paper.
    rule: When it is hidden.

Returns:
    votes: [N] int32, V(g).
    views: [N] int32, views in which the centre can be seen at all.

Raises:
    ValueError: An image does not fit its camera, or the rule is out of range.

Source: GS-LTS, sec. III-D, eq. of V(g_i).)");
  m.def("sightings_of", &sightings_of, py::arg("gaussians"), py::arg("cameras"),
        py::arg("measured"), py::arg("rule"),
        R"(Counts the views that saw a surface at the centre of each of N Gaussians, or through it.

Args:
    gaussians: Of a map.
    cameras: Of the views.
    measured: [H,W] float32 of each, depth, z, m; 0 and NaN mean no measurement.
    rule: When two depths are the same.

Returns:
    on: [N] int32, views that measured a surface there.
    through: [N] int32, views that measured one behind it: nothing can be there.

Raises:
    ValueError: An image does not fit its camera, or the rule is out of range.)");
  m.def("nearest_gaussians", &nearest_gaussians, py::arg("gaussians"), py::arg("points"),
        py::arg("k").noconvert(),
        R"(The k Gaussians whose centres are nearest to each of Q points, exactly.

Args:
    gaussians: Of a map, at least one.
    points: [Q,3] float32, relative to the map's origin, m.
    k: At least 1; fewer are found where there are fewer Gaussians.

Returns:
    rows: [Q,k] uint32, the nearest first.
    distances_m: [Q,k] float32.

Raises:
    ValueError: There is no Gaussian, k is below 1, or a number is not finite.)");
  m.def("thinned", &thinned, py::arg("points"), py::arg("spacing_m"),
        R"(Rows of the points that stay when each, in order, must keep a distance from those before.

Args:
    points: [P,3] float32, m.
    spacing_m: [P] float32 that a point keeps from all that stay before it.

Returns:
    [M] uint32, ascending.

Raises:
    ValueError: A point is not finite, or a spacing is not positive and finite.)");
  m.def("inherited", &inherited, py::arg("gaussians"), py::arg("points"), py::arg("rows"),
        py::arg("first_id"),
        R"(The arrays of new Gaussians at points, with everything else from others.

Args:
    gaussians: Of a map.
    points: [P,3] float32 centres, relative to the map's origin, m.
    rows: [P] uint32, of which each inherits.
    first_id: The ids are first_id, first_id + 1, ...

Raises:
    ValueError: There is no such row.

Source: GS-LTS, sec. III-D, the pre-editing of an addition, step iii.)");
}

}  // namespace gslts::python
