#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "gslts/detect/components.hpp"
#include "gslts/detect/gs_lts_rule.hpp"
#include "gslts/detect/masks.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/regions.hpp"
#include "gslts/detect/shifts.hpp"

namespace gslts::python {

void define_detect_rules(py::module_ m);
void define_detect_values(py::module_ m);

namespace {

using detect::GsLtsChange;
using detect::GsLtsRule;
using detect::MaskRule;
using detect::Masks;
using detect::ObjectRule;
using detect::Region;
using detect::Surface;
using detect::Views;
using Arrays = py::typing::Dict<py::str, py::array>;
using Labels = py::array_t<std::int32_t>;

/// Views whose arrays stay alive with it.
struct OwnedViews {
  Views views;
  py::tuple arrays;
};

OwnedViews make_views(const Camera& camera, const py::array& observed_rgb,
                      const py::array& rendered_rgb, const py::array& observed_depth,
                      const py::array& rendered_depth, const py::array& alpha,
                      const py::array& similarity, const std::optional<py::array>& depth_error,
                      const std::optional<py::array>& color_error,
                      const std::pair<double, double>& noise) {
  const py::ssize_t height = camera.height, width = camera.width;
  const auto optional = [&](const std::optional<py::array>& array, const char* name) {
    return array ? require_array<float>(*array, name, {height, width}) : nullptr;
  };
  const Views views{camera,
                    require_array<float>(observed_rgb, "observed_rgb", {height, width, 3}),
                    require_array<float>(rendered_rgb, "rendered_rgb", {height, width, 3}),
                    require_array<float>(observed_depth, "observed_depth", {height, width}),
                    require_array<float>(rendered_depth, "rendered_depth", {height, width}),
                    require_array<float>(alpha, "alpha", {height, width}),
                    require_array<float>(similarity, "similarity", {height, width}),
                    optional(depth_error, "depth_error"),
                    optional(color_error, "color_error"),
                    {noise.first, noise.second}};
  return {views, py::make_tuple(observed_rgb, rendered_rgb, observed_depth, rendered_depth, alpha,
                                similarity, depth_error, color_error)};
}

/// @throws std::invalid_argument  if the masks are of images of another size.
void require_size(const Masks& masks, const Camera& camera) {
  const std::size_t size = std::size_t(camera.width) * std::size_t(camera.height);
  if (masks.known.size() != size) {
    throw std::invalid_argument("masks: they have " + std::to_string(masks.known.size()) +
                                " pixels, the camera has " + std::to_string(size));
  }
}

Masks compute_masks(const OwnedViews& owned, const MaskRule& rule) {
  const py::gil_scoped_release release;
  return detect::compute_masks(owned.views, rule);
}

Arrays mask_arrays(const Masks& masks, const Camera& camera) {
  require_size(masks, camera);
  const auto to_bools = [&](Array<std::uint8_t> mask) {
    return to_numpy(std::move(mask), {camera.height, camera.width}).view("bool");
  };
  Arrays arrays;
  arrays["known"] = to_bools(masks.known);
  arrays["pixel"] = to_bools(masks.pixel);
  arrays["feature"] = to_bools(masks.feature);
  arrays["combined"] = to_bools(masks.combined);
  return arrays;
}

std::pair<std::optional<GsLtsChange>, Labels> detect_gs_lts(const OwnedViews& owned,
                                                            const Masks& masks,
                                                            const GsLtsRule& rule) {
  const Camera& camera = owned.views.camera;
  require_size(masks, camera);
  auto [components, change] = [&] {
    const py::gil_scoped_release release;
    auto parts = detect::connected_components(masks.combined.data(), camera.width, camera.height);
    auto found = detect::detect_gs_lts(owned.views, parts, rule);
    return std::pair(std::move(parts), std::move(found));
  }();
  return {std::move(change), to_numpy(std::move(components.labels), {camera.height, camera.width})};
}

template <auto find>
std::pair<std::vector<Surface>, Labels> find_surfaces(const OwnedViews& owned, const Masks& masks,
                                                      const ObjectRule& rule) {
  const Camera& camera = owned.views.camera;
  require_size(masks, camera);
  detect::Surfaces found = [&] {
    const py::gil_scoped_release release;
    return find(owned.views, masks, rule);
  }();
  return {std::move(found.surfaces),
          to_numpy(std::move(found.labels), {camera.height, camera.width})};
}

std::vector<Region> find_regions(const OwnedViews& owned, const Masks& masks,
                                 const ObjectRule& rule) {
  require_size(masks, owned.views.camera);
  const py::gil_scoped_release release;
  return detect::find_regions(owned.views, masks, rule);
}

std::vector<detect::Shift> find_shifts(const OwnedViews& owned, const Masks& masks,
                                       const std::vector<Surface>& surfaces,
                                       const py::array& labels, const ObjectRule& rule) {
  const Camera& camera = owned.views.camera;
  require_size(masks, camera);
  const std::int32_t* begin =
      require_array<std::int32_t>(labels, "labels", {camera.height, camera.width});
  const Array<std::int32_t> copy(begin, begin + owned.views.size());
  const py::gil_scoped_release release;
  return detect::find_shifts(owned.views, masks, surfaces, copy, rule);
}

void define_views(py::module_& m) {
  py::class_<OwnedViews>(m, "Views", R"(A frame and a rendering of the map from the same camera.

Args:
    camera: Of all images.
    observed_rgb: [H,W,3] float32, sRGB, 0 to 1; this and all others C-contiguous.
    rendered_rgb: [H,W,3] float32, sRGB, with the exposure of the frame.
    observed_depth: [H,W] float32, z in the camera frame, m; 0 and NaN: not measured.
    rendered_depth: [H,W] float32, z in the camera frame, m; 0 where nothing is.
    alpha: [H,W] float32, opacity of the map, 0 to 1.
    similarity: [H,W] float32, cosine of the features of both images, -1 to 1.
    depth_error: [H,W] float32, expected error of the rendered depth, m; None if it is not known.
    color_error: [H,W] float32, expected error of the rendered colours, summed over the channels.
    noise: (a, b), m and 1/m: the standard deviation of the difference of measured and rendered
        depths z of an unchanged surface is a + b z^2. Neither is negative, and not both are 0.

Raises:
    ValueError: An array has another shape, type or layout.)")
      .def(py::init(&make_views), py::kw_only(), py::arg("camera"), py::arg("observed_rgb"),
           py::arg("rendered_rgb"), py::arg("observed_depth"), py::arg("rendered_depth"),
           py::arg("alpha"), py::arg("similarity"), py::arg("depth_error") = std::nullopt,
           py::arg("color_error") = std::nullopt,
           py::arg("noise") =
               std::pair(detect::DepthNoise().constant_m, detect::DepthNoise().per_m));
}

void define_masks(py::module_& m) {
  py::class_<Masks>(m, "Masks", "Masks of one pair of images, from `compute_masks`.");
  m.def("compute_masks", &compute_masks, py::arg("views"), py::arg("rule"),
        R"(Compute the two branches of change detection and their product.

The paper prints M_feat = (similarity > tau_feat), which marks what did not change; here features
differ where their similarity is low.

Args:
    views: Frame and rendering.
    rule: Thresholds.

Returns:
    The masks; `mask_arrays` converts them to numpy.

Raises:
    ValueError: A threshold is out of range.

Source: GS-LTS, sec. III-C1, eq. 4 and 5.)");
  m.def("mask_arrays", &mask_arrays, py::arg("masks"), py::arg("camera"),
        R"(Copy masks to arrays.

Args:
    masks: From `compute_masks`.
    camera: Of the images.

Returns:
    [H,W] bool by name: "known" (the map is known there), "pixel" (M_pixel), "feature" (M_feat) and
    "combined" (M_comb).

Raises:
    ValueError: The masks have another size than the camera.)");
}

void define_detections(py::module_& m) {
  m.def("detect_gs_lts", &detect_gs_lts, py::arg("views"), py::arg("masks"), py::arg("rule"),
        R"(Predict change type and key point as printed in GS-LTS.

Args:
    views: Frame and rendering.
    masks: Of the same views.
    rule: Thresholds.

Returns:
    The change, None if there is none, and [H,W] int32 labels of the components of M_comb.

Raises:
    ValueError: A threshold is out of range, or the masks have another size.

Source: GS-LTS, sec. III-C2, eq. 6 to 10.)");
  m.def("find_changed_surfaces", &find_surfaces<&detect::find_changed_surfaces>, py::arg("views"),
        py::arg("masks"), py::arg("rule"),
        R"(Find the surfaces that only one of map and frame shows.

Args:
    views: Frame and rendering.
    masks: Of the same views.
    rule: Thresholds.

Returns:
    The surfaces, and [H,W] int32 their labels, 0 where nothing changed.

Raises:
    ValueError: A threshold or the noise is out of range, or the masks have another size.)");
  m.def("find_changed_regions", &find_surfaces<&detect::find_changed_regions>, py::arg("views"),
        py::arg("masks"), py::arg("rule"),
        R"(Find the objects that only one of map and frame shows, by colours and coarse depth.

For depth that is coarser than the steps that `find_changed_surfaces` looks for, or missing.

Args:
    views: Frame and rendering.
    masks: Of the same views.
    rule: Thresholds.

Returns:
    Surfaces with a `color_confidence`, the highest first, and [H,W] int32 their labels, 0 where
    nothing changed.

Raises:
    ValueError: A threshold is out of range, or the masks have another size.)");
  m.def("find_regions", &find_regions, py::arg("views"), py::arg("masks"), py::arg("rule"),
        R"(List the regions that `find_changed_regions` chooses from; they may overlap.

Args:
    views: Frame and rendering.
    masks: Of the same views.
    rule: Thresholds.

Returns:
    The regions of frame and rendering.

Raises:
    ValueError: A threshold is out of range, or the masks have another size.)");
  m.def("find_shifts", &find_shifts, py::arg("views"), py::arg("masks"), py::arg("surfaces"),
        py::arg("labels"), py::arg("rule"),
        R"(Find small rigid motions over the floor that explain changed surfaces.

Args:
    views: Frame and rendering.
    masks: Of the same views.
    surfaces: Surfaces visible in only one of map and frame.
    labels: [H,W] int32, label of the surface at each pixel, 0 for none.
    rule: Thresholds.

Returns:
    The shifts; each surface belongs to one of them at most.

Raises:
    ValueError: A threshold is out of range, or the masks or labels have another size.)");
  m.def("classify_changes", &detect::classify_changes, py::arg("surfaces"), py::arg("rule"),
        R"(Classify surfaces as additions, removals and relocations.

What vanished and what appeared are one object if they match in colours and size.

Args:
    surfaces: Of one pair of images, or of several.
    rule: Thresholds.

Returns:
    Changes with at least `rule.min_confidence`, the highest confidence first.

Raises:
    ValueError: A threshold or a number of a surface is out of range.)");
}

void define_scores(py::module_& m) {
  m.def("confidence", &detect::confidence, py::arg("surface"),
        R"(Compute how likely a surface belongs to an object that changed.

Args:
    surface: Of either side.

Returns:
    Calibrated probability, 0 to 1.)");
  m.def("confidence_features", &detect::confidence_features, py::arg("surface"),
        R"(Compute the numbers that `confidence` weighs.

Args:
    surface: Of either side.

Returns:
    Features of the logistic regression.)");
  m.def("match_score", &detect::match_score, py::arg("before"), py::arg("after"),
        R"(Score how likely two surfaces of one frame are one object.

Args:
    before: A surface of the map.
    after: A surface of the frame.

Returns:
    Probability, 0 to 1.)");
  m.def("match_features", &detect::match_features, py::arg("before"), py::arg("after"),
        R"(Compute the numbers that `match_score` weighs.

Args:
    before: A surface of the map.
    after: A surface of the frame.

Returns:
    Hellinger distance of the colour histograms, and the logarithm of the ratio of the heights after
    and before, 0 if it is smaller.)");
}

}  // namespace

void define_detect(py::module_ m) {
  define_detect_rules(m);
  define_detect_values(m);
  define_views(m);
  define_masks(m);
  define_detections(m);
  define_scores(m);
}

}  // namespace gslts::python
