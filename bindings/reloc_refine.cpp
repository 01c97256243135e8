#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
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

/// The images of cameras, one each.
/// @throws std::invalid_argument  if there is not one image per camera.
std::vector<RgbdView<float>> views_of(const std::vector<Camera>& cameras, const Images& photos,
                                      const std::optional<Images>& measured,
                                      const std::optional<Images>& masks) {
  require_one_each("photos", photos, cameras.size());
  if (measured) require_one_each("measured", *measured, cameras.size());
  if (masks) require_one_each("masks", *masks, cameras.size());
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
  if (views.empty()) throw std::invalid_argument("refine_pose: cameras must not be empty");
  const py::gil_scoped_release release;
  return reloc::refine_pose(maps, views, cameras[0].world_from_camera, rule);
}

void define_rules(py::module_& m) {
  const RefineRule refine;
  const CostRule& cost = refine.cost;
  py::class_<RefineRule>(m, "RefineRule", R"(Settings of the refinement of a pose.

Args:
    iterations: Maximum number at each resolution.
    min_step_m: Length of a step, m and rad, below which it is the last one at full size; twice as
        much at half the size, and so on.
    color_scale: Scale of the robust loss of a colour difference, 0 to 1.
    depth_scale: The same of a relative depth difference.
    depth_weight: Weight of depth against colour.
    alpha_min: Minimum alpha where the map is known.
    far_m: Far plane of the rendering, m.
    threads: 0 means one per hardware thread.)")
      .def(py::init([](int iterations, double min_step_m, double color_scale, double depth_scale,
                       double depth_weight, double alpha_min, double far_m, int threads) {
             RefineRule rule;
             rule.cost = {color_scale, depth_scale, depth_weight, alpha_min, {}};
             rule.cost.render.far_m = far_m;
             rule.cost.render.threads = threads;
             rule.iterations = iterations;
             rule.min_step_m = min_step_m;
             return rule;
           }),
           py::kw_only(), py::arg("iterations") = refine.iterations,
           py::arg("min_step_m") = refine.min_step_m, py::arg("color_scale") = cost.color_scale,
           py::arg("depth_scale") = cost.depth_scale, py::arg("depth_weight") = cost.depth_weight,
           py::arg("alpha_min") = cost.alpha_min, py::arg("far_m") = cost.render.far_m,
           py::arg("threads") = cost.render.threads);
}

void define_results(py::module_& m) {
  py::class_<Fit>(m, "Fit", R"(How well an image fits a map, in shares of pixels.

Attributes:
    known: Of the pixels that may count: where the map is known.
    alike: Of these: where colours differ by less than `color_scale`.
    measured: Of the known pixels: where depth was measured.
    near: Of these: where depth differs by less than `depth_scale`.)")
      .def_readonly("known", &Fit::known)
      .def_readonly("alike", &Fit::alike)
      .def_readonly("measured", &Fit::measured)
      .def_readonly("near", &Fit::near);
  py::class_<RefinedPose>(m, "RefinedPose", R"(The pose at which an image fits a map best.

Attributes:
    world_from_camera: [4,4].
    curvature: [6,6] of the cost at the pose, by a twist (rho, phi) of
        world_from_camera @ exp(rho, phi), m before rad.
    cost: Mean over the known pixels.
    fit: How well the image fits there.
    iterations: Sum over all resolutions.
    converged: Whether the last resolution converged within its iterations.)")
      .def_property_readonly("world_from_camera",
                             [](const RefinedPose& pose) -> Eigen::Matrix4d {
                               return pose.world_from_camera.matrix();
                             })
      .def_property_readonly("curvature",
                             [](const RefinedPose& pose) -> Matrix6 { return pose.curvature; })
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
        py::arg("rule"), R"(Refine the pose of an image in a map.

Args:
    maps: Views of a float32 map: one for all images, or one per image.
    cameras: Cameras of one image in several resolutions, the coarsest first; the search starts at
        the pose of the first one.
    photos: [H,W,3] float32 sRGB of each, 0 to 1.
    measured: [H,W] float32 depth of each, m, 0 or NaN where there is none; None means without.
    masks: [H,W] bool of each, pixels that may count; None means all.
    rule: Settings.

Returns:
    The pose; the start, not converged, if the map is not seen from there.

Raises:
    ValueError: An array does not fit its camera, or a camera or a setting is invalid.

Source: iComMa, Sun et al. 2023.)");
}

}  // namespace gslts::python
