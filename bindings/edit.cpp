#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "gslts/edit/inherit_attributes.hpp"
#include "gslts/edit/nearest.hpp"
#include "gslts/edit/thin_points.hpp"
#include "gslts/edit/visibility.hpp"
#include "gslts/edit/votes.hpp"
#include "map_arrays.hpp"

namespace gslts::python {
namespace {

using edit::DepthTolerance;
using edit::DepthView;
using edit::VoteRule;
using edit::VotingView;

using Counts = py::typing::Tuple<py::array_t<std::int32_t>, py::array_t<std::int32_t>>;
using ImageList = std::vector<py::array>;

Counts to_counts(Array<std::int32_t>&& first, Array<std::int32_t>&& second) {
  const auto size = static_cast<py::ssize_t>(first.size());
  return py::make_tuple(to_numpy(std::move(first), {size}), to_numpy(std::move(second), {size}));
}

Counts count_votes(const GaussianView<float>& gaussians, const std::vector<Camera>& cameras,
                   const ImageList& masks, const std::optional<ImageList>& rendered_depths,
                   const VoteRule& rule) {
  require_one_each("masks", masks, cameras.size());
  if (rendered_depths) require_one_each("rendered_depths", *rendered_depths, cameras.size());
  std::vector<VotingView> views;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const std::vector<py::ssize_t> shape = {cameras[k].height, cameras[k].width};
    const bool* mask = require_array<bool>(masks[k], "masks", shape);
    const float* depth = rendered_depths
                             ? require_array<float>((*rendered_depths)[k], "rendered_depths", shape)
                             : nullptr;
    views.push_back({cameras[k], reinterpret_cast<const std::uint8_t*>(mask), depth});
  }
  edit::Votes votes = [&] {
    const py::gil_scoped_release release;
    return edit::count_votes(gaussians, views, rule);
  }();
  return to_counts(std::move(votes.votes), std::move(votes.views));
}

Counts count_visibility(const GaussianView<float>& gaussians, const std::vector<Camera>& cameras,
                        const ImageList& observed_depths, const DepthTolerance& tolerance) {
  require_one_each("observed_depths", observed_depths, cameras.size());
  std::vector<DepthView> views;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    views.push_back({cameras[k], require_array<float>(observed_depths[k], "observed_depths",
                                                      {cameras[k].height, cameras[k].width})});
  }
  edit::VisibilityCounts counts = [&] {
    const py::gil_scoped_release release;
    return edit::count_visibility(gaussians, views, tolerance);
  }();
  return to_counts(std::move(counts.on_surface), std::move(counts.seen_through));
}

py::typing::Tuple<py::array_t<std::uint32_t>, py::array_t<float>> nearest_gaussians(
    const GaussianView<float>& gaussians, const py::array& points, int k) {
  const float* positions = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  edit::Neighbours found = [&] {
    const py::gil_scoped_release release;
    return edit::nearest_gaussians(gaussians, positions, std::size_t(count), k);
  }();
  return py::make_tuple(to_numpy(std::move(found.rows), {count, found.k}),
                        to_numpy(std::move(found.distances_m), {count, found.k}));
}

py::array_t<std::uint32_t> thin_points(const py::array& points, const py::array& spacing_m) {
  const float* positions = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  const float* spacing = require_array<float>(spacing_m, "spacing_m", {count});
  Array<std::uint32_t> rows = [&] {
    const py::gil_scoped_release release;
    return edit::thin_points(positions, spacing, std::size_t(count));
  }();
  const auto size = static_cast<py::ssize_t>(rows.size());
  return to_numpy(std::move(rows), {size});
}

MapArrays inherit_attributes(const GaussianView<float>& gaussians, const py::array& points,
                             const py::array& rows, std::uint64_t first_id) {
  const float* positions = require_array<float>(points, "points", {kAnyLength, 3});
  const py::ssize_t count = points.shape(0);
  const auto* parents = require_array<std::uint32_t>(rows, "rows", {count});
  return arrays_of(
      edit::inherit_attributes(gaussians, positions, parents, std::size_t(count), first_id));
}

void define_rules(py::module_& m) {
  const VoteRule vote;
  py::class_<VoteRule>(
      m, "VoteRule",
      R"(Maximum distance behind the rendered surface at which a Gaussian belongs to it; immutable.

It is behind_m + behind_share depth; farther behind a Gaussian is hidden.

Args:
    behind_m: Constant part, m.
    behind_share: Share of the rendered depth.)")
      .def(py::init([](double behind_m, double behind_share) {
             return VoteRule{behind_m, behind_share};
           }),
           py::kw_only(), py::arg("behind_m") = vote.behind_m,
           py::arg("behind_share") = vote.behind_share)
      .def_readonly("behind_m", &VoteRule::behind_m)
      .def_readonly("behind_share", &VoteRule::behind_share);

  const DepthTolerance tolerance;
  py::class_<DepthTolerance>(m, "DepthTolerance",
                             R"(Maximum difference of two depths of one surface; immutable.

It is margin_m + margin_share depth.

Args:
    margin_m: Constant part, m.
    margin_share: Share of the depth.)")
      .def(py::init([](double margin_m, double margin_share) {
             return DepthTolerance{margin_m, margin_share};
           }),
           py::kw_only(), py::arg("margin_m") = tolerance.margin_m,
           py::arg("margin_share") = tolerance.margin_share)
      .def_readonly("margin_m", &DepthTolerance::margin_m)
      .def_readonly("margin_share", &DepthTolerance::margin_share);
}

void define_counts(py::module_& m) {
  m.def("count_votes", &count_votes, py::arg("gaussians"), py::arg("cameras"), py::arg("masks"),
        py::arg("rendered_depths"), py::arg("rule"),
        R"(Count the views in whose mask the centre of each of N Gaussians is seen.

Args:
    gaussians: Of a map.
    cameras: Of the K views.
    masks: K masks [H,W] bool, M_comb; True where the image shows what changed.
    rendered_depths: K images [H,W] float32, z of the map's surface in the camera frame, m, 0 where
        there is none: hidden Gaussians get no votes. None: they do, as in GS-LTS.
    rule: When a Gaussian is hidden.

Returns:
    votes: [N] int32, V(g).
    views: [N] int32, views in which the centre is seen.

Raises:
    ValueError: An image does not fit its camera, or the rule is out of range.

Source: GS-LTS, sec. III-D2, eq. 11.)");
  m.def(
      "count_visibility", &count_visibility, py::arg("gaussians"), py::arg("cameras"),
      py::arg("observed_depths"), py::arg("tolerance"),
      R"(Count the views that saw a surface at the centre of each of N Gaussians, or saw through it.

Args:
    gaussians: Of a map.
    cameras: Of the K views.
    observed_depths: K images [H,W] float32, z in the camera frame, m; 0 and NaN: not measured.
    tolerance: When two depths are those of one surface.

Returns:
    on_surface: [N] int32, views that measured a surface at the centre.
    seen_through: [N] int32, views that measured one behind it: it is free space.

Raises:
    ValueError: An image does not fit its camera, or the tolerance is out of range.)");
}

void define_points(py::module_& m) {
  m.def("nearest_gaussians", &nearest_gaussians, py::arg("gaussians"), py::arg("points"),
        py::arg("k").noconvert(),
        R"(Find the k Gaussians whose centres are nearest to each of Q points, exactly.

Args:
    gaussians: Of a map, at least one.
    points: [Q,3] float32, relative to the map's origin, m.
    k: At least 1; fewer are found where there are fewer Gaussians.

Returns:
    rows: [Q,k] uint32, the nearest first.
    distances_m: [Q,k] float32.

Raises:
    ValueError: There is no Gaussian, k is below 1, or a number is not finite.)");
  m.def("thin_points", &thin_points, py::arg("points"), py::arg("spacing_m"),
        R"(Select points that keep a distance from each other.

Each point, in order, is kept if no point kept before it is nearer than its spacing.

Args:
    points: [P,3] float32, m.
    spacing_m: [P] float32, minimum distance of each point from those kept before it, m.

Returns:
    [M] uint32, rows of the points kept, ascending.

Raises:
    ValueError: A point is not finite, or a spacing is not positive and finite.)");
  m.def("inherit_attributes", &inherit_attributes, py::arg("gaussians"), py::arg("points"),
        py::arg("rows"), py::arg("first_id"),
        R"(Create Gaussians at points with the attributes of others.

Args:
    gaussians: Of a map.
    points: [P,3] float32, centres relative to the map's origin, m.
    rows: [P] uint32, rows of the Gaussians to inherit from.
    first_id: The ids are first_id, first_id + 1, ...

Returns:
    Arrays of a `GaussianMap` by name.

Raises:
    ValueError: There is no such row.

Source: GS-LTS, sec. III-D2, the pre-editing of an addition, steps iii and iv (eq. 12).)");
}

}  // namespace

void define_edit(py::module_ m) {
  define_rules(m);
  define_counts(m);
  define_points(m);
}

}  // namespace gslts::python
