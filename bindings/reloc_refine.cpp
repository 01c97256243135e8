#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "gslts/reloc/refine_pose.hpp"

namespace gslts::python {
namespace {

using align::CostRule;
using align::Fit;
using align::RgbdView;
using reloc::RefinedPose;
using reloc::RefineRule;

using Images = std::vector<py::array>;

/// The pictures that cameras took, one each.
/// @throws std::invalid_argument  if there is not one image a camera.
std::vector<RgbdView<float>> views_of(const std::vector<Camera>& cameras, const Images& photos,
                                      const std::optional<Images>& measured,
                                      const std::optional<Images>& masks) {
  const auto require_one_each = [&](const char* name, const Images& images) {
    if (images.size() == cameras.size()) return;
    throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(cameras.size()) +
                                ", one a camera, got " + std::to_string(images.size()));
  };
  require_one_each("photos", photos);
  if (measured) require_one_each("measured", *measured);
  if (masks) require_one_each("masks", *masks);
  std::vector<RgbdView<float>> views;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const py::ssize_t height = cameras[k].height, width = cameras[k].width;
    RgbdView<float> view;
    view.camera = cameras[k];
    view.photo = require_array<float>(photos[k], "photos", {height, width, 3});
    if (measured) view.measured = require_array<float>((*measured)[k], "measured", {height, width});
    if (masks) {
      const bool* wanted = require_array<bool>((*masks)[k], "masks", {height, width});
      view.mask = reinterpret_cast<const std::uint8_t*>(wanted);
    }
    views.push_back(view);
  }
  return views;
}

RefinedPose refine_pose(const std::vector<GaussianView<float>>& maps,
                        const std::vector<Camera>& cameras, const Images& photos,
                        const std::optional<Images>& measured, const std::optional<Images>& masks,
                        const RefineRule& rule) {
  const std::vector<RgbdView<float>> views = views_of(cameras, photos, measured, masks);
  if (views.empty()) throw std::invalid_argument("refine_pose: cameras: there is none");
  const py::gil_scoped_release release;
  return reloc::refine_pose(maps, views, cameras[0].world_from_camera, rule);
}

void define_rules(py::module_& m) {
  const RefineRule refine;
  const CostRule& cost = refine.cost;
  py::class_<RefineRule>(m, "RefineRule", R"(How a pose is refined.

Args:
    iterations: At each resolution, at most.
    least_step_m: A step that is shorter, and turns less than so many rad, is the last one; twice as
        much at half the resolution, and so on.
    color_scale: Difference of a channel at which trust begins to end.
    depth_scale: The same of the depth, as a share of it.
    depth_weight: Of the depth, against the colours.
    alpha_min: Where less of the map is, it was never seen.
    threads: 0 means one a hardware thread.)")
      .def(py::init([](int iterations, double least_step_m, double color_scale, double depth_scale,
                       double depth_weight, double alpha_min, int threads) {
             RefineRule rule;
             rule.cost = {color_scale, depth_scale, depth_weight, alpha_min, {}};
             rule.cost.render.threads = threads;
             rule.iterations = iterations;
             rule.least_step_m = least_step_m;
             return rule;
           }),
           py::kw_only(), py::arg("iterations") = refine.iterations,
           py::arg("least_step_m") = refine.least_step_m, py::arg("color_scale") = cost.color_scale,
           py::arg("depth_scale") = cost.depth_scale, py::arg("depth_weight") = cost.depth_weight,
           py::arg("alpha_min") = cost.alpha_min, py::arg("threads") = cost.render.threads);
}

void define_results(py::module_& m) {
  py::class_<Fit>(m, "Fit", R"(How well a picture fits a map.

Attributes:
    known: Share of the pixels that may count that the map fills.
    alike: Share of that where colours are alike.
    measured: Share of that where depth was measured.
    near: Share of this where it is near that of the map.)")
      .def_readonly("known", &Fit::known)
      .def_readonly("alike", &Fit::alike)
      .def_readonly("measured", &Fit::measured)
      .def_readonly("near", &Fit::near);
  py::class_<RefinedPose>(m, "RefinedPose", R"(A pose where a picture fits a map best.

Attributes:
    world_from_camera: [4,4].
    curvature: [6,6] of the cost there, by a twist (rho, phi) of world_from_camera @ exp(rho, phi):
        m before rad.
    cost: Mean over the pixels that count.
    fit: There, too.
    iterations: Of all resolutions.
    converged: Whether the last resolution ended before its iterations did.)")
      .def_property_readonly("world_from_camera",
                             [](const RefinedPose& pose) -> Eigen::Matrix4d {
                               return pose.world_from_camera.matrix();
                             })
      .def_property_readonly(
          "curvature", [](const RefinedPose& pose) -> align::Matrix6 { return pose.curvature; })
      .def_readonly("cost", &RefinedPose::cost)
      .def_readonly("fit", &RefinedPose::fit)
      .def_readonly("iterations", &RefinedPose::iterations)
      .def_readonly("converged", &RefinedPose::converged);
}

}  // namespace

void define_reloc_refine(py::module_ m) {
  define_rules(m);
  define_results(m);
  m.def("refine_pose", &refine_pose, py::arg("maps"), py::arg("cameras"), py::arg("photos"),
        py::kw_only(), py::arg("measured") = py::none(), py::arg("masks") = py::none(),
        py::arg("rule"), R"(Where a picture fits a map best, near a pose.

Args:
    maps: Views of a float32 map: one for all pictures, or one for each.
    cameras: Of one picture in several resolutions, the coarsest first; the pose of the first one is
        where the search starts.
    photos: [H,W,3] float32 sRGB of each, 0 to 1.
    measured: [H,W] float32 depth of each, m, 0 or NaN where there is none; None means without.
    masks: [H,W] bool of each, pixels that may count; None means all.
    rule: Settings.

Source: iComMa, Sun et al. 2023.)");
}

}  // namespace gslts::python
