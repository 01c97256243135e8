#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "gslts/detect/components.hpp"
#include "gslts/detect/masks.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/paper_rule.hpp"

namespace gslts::python {
namespace {

using detect::ChangeType;
using detect::Component;
using detect::Evidence;
using detect::MaskRule;
using detect::Masks;
using detect::ObjectChange;
using detect::ObjectRule;
using detect::PaperChange;
using detect::PaperRule;
using detect::Side;
using detect::Sights;
using detect::Surface;
using detect::Views;
using Arrays = py::typing::Dict<py::str, py::array>;

Views views_of(const Camera& camera, const py::array& photo, const py::array& rgb,
               const py::array& measured, const py::array& rendered, const py::array& alpha,
               const py::array& similarity) {
  const py::ssize_t height = camera.height, width = camera.width;
  return {camera,
          require_array<float>(photo, "photo", {height, width, 3}),
          require_array<float>(rgb, "rgb", {height, width, 3}),
          require_array<float>(measured, "measured", {height, width}),
          require_array<float>(rendered, "rendered", {height, width}),
          require_array<float>(alpha, "alpha", {height, width}),
          require_array<float>(similarity, "similarity", {height, width})};
}

/// Views whose arrays stay alive with it.
struct OwnedViews {
  Views views;
  py::tuple arrays;
};

/// @throws std::invalid_argument  if the masks are of images of another size.
void require_size(const Masks& masks, const Camera& camera) {
  const std::size_t size = std::size_t(camera.width) * std::size_t(camera.height);
  if (masks.known.size() != size) {
    throw std::invalid_argument("masks: they have " + std::to_string(masks.known.size()) +
                                " pixels, the camera has " + std::to_string(size));
  }
}

py::array_t<bool> to_bools(Array<std::uint8_t>&& mask, const Camera& camera) {
  return to_numpy(std::move(mask), {camera.height, camera.width}).view("bool");
}

void define_rules(py::module_& m) {
  const MaskRule mask;
  py::class_<MaskRule>(m, "MaskRule", R"(Where a photo and a rendering differ (GS-LTS, sec. III-C).

Args:
    tau_gs: Sum over the channels of absolute differences, 0 to 3.
    tau_feat: Cosine of the features below which they differ.
    alpha_min: Where less of the map is, it was never seen.
    clean_px: Radius by which specks are opened, and cracks closed.)")
      .def(py::init([](double tau_gs, double tau_feat, double alpha_min, int clean_px) {
             return MaskRule{tau_gs, tau_feat, alpha_min, clean_px};
           }),
           py::kw_only(), py::arg("tau_gs") = mask.tau_gs, py::arg("tau_feat") = mask.tau_feat,
           py::arg("alpha_min") = mask.alpha_min, py::arg("clean_px").noconvert() = mask.clean_px)
      .def_readonly("tau_gs", &MaskRule::tau_gs)
      .def_readonly("tau_feat", &MaskRule::tau_feat)
      .def_readonly("alpha_min", &MaskRule::alpha_min)
      .def_readonly("clean_px", &MaskRule::clean_px);

  const PaperRule paper;
  py::class_<PaperRule>(m, "PaperRule", R"(Thresholds of GS-LTS, sec. III-C.

Args:
    tau_change: Share of the image that M_comb must exceed.
    tau_a: Area similarity of a relocation's two regions.
    tau_d: Their distance, as a share of the width of the image.
    epsilon: Depth difference of an addition or a removal, m.)")
      .def(py::init([](double tau_change, double tau_a, double tau_d, double epsilon) {
             return PaperRule{tau_change, tau_a, tau_d, epsilon};
           }),
           py::kw_only(), py::arg("tau_change") = paper.tau_change, py::arg("tau_a") = paper.tau_a,
           py::arg("tau_d") = paper.tau_d, py::arg("epsilon") = paper.epsilon)
      .def_readonly("tau_change", &PaperRule::tau_change)
      .def_readonly("tau_a", &PaperRule::tau_a)
      .def_readonly("tau_d", &PaperRule::tau_d)
      .def_readonly("epsilon", &PaperRule::epsilon);

  const ObjectRule object;
  py::class_<ObjectRule>(m, "ObjectRule",
                         R"(How changed objects are told from errors of sensor, pose and map.

Args:
    step_m: A surface counts as nearer by so much, across it,
    step_per_m: by so much more times the square of its depth in m,
    step_px: and by what its depth changes within so many pixels.
    reach_px: By which edges may be misplaced.
    least_area_m2: Smaller surfaces, facing the camera, are no objects.
    least_area_px: Nor are smaller parts of the image.
    flat_area_m2: The same where colours alone differ,
    flat_color: summed over the channels, from all that is around.
    flat_step_m: A mean difference of depths that tells the side.
    least_contrast: Of brightness a pixel, across the outline of a flat object.
    alike: How likely the ends of a relocation must be one object, 0 to 1.
    certain: Less likely changes are not reported.)")
      .def(py::init([](double step_m, double step_per_m, double step_px, int reach_px,
                       double least_area_m2, int least_area_px, double flat_area_m2,
                       double flat_color, double flat_step_m, double least_contrast, double alike,
                       double certain) {
             return ObjectRule{step_m,        step_per_m,     step_px,      reach_px,
                               least_area_m2, least_area_px,  flat_area_m2, flat_color,
                               flat_step_m,   least_contrast, alike,        certain};
           }),
           py::kw_only(), py::arg("step_m") = object.step_m,
           py::arg("step_per_m") = object.step_per_m, py::arg("step_px") = object.step_px,
           py::arg("reach_px").noconvert() = object.reach_px,
           py::arg("least_area_m2") = object.least_area_m2,
           py::arg("least_area_px").noconvert() = object.least_area_px,
           py::arg("flat_area_m2") = object.flat_area_m2, py::arg("flat_color") = object.flat_color,
           py::arg("flat_step_m") = object.flat_step_m,
           py::arg("least_contrast") = object.least_contrast, py::arg("alike") = object.alike,
           py::arg("certain") = object.certain)
      .def_readonly("step_m", &ObjectRule::step_m)
      .def_readonly("step_per_m", &ObjectRule::step_per_m)
      .def_readonly("step_px", &ObjectRule::step_px)
      .def_readonly("reach_px", &ObjectRule::reach_px)
      .def_readonly("least_area_m2", &ObjectRule::least_area_m2)
      .def_readonly("least_area_px", &ObjectRule::least_area_px)
      .def_readonly("flat_area_m2", &ObjectRule::flat_area_m2)
      .def_readonly("flat_color", &ObjectRule::flat_color)
      .def_readonly("flat_step_m", &ObjectRule::flat_step_m)
      .def_readonly("least_contrast", &ObjectRule::least_contrast)
      .def_readonly("alike", &ObjectRule::alike)
      .def_readonly("certain", &ObjectRule::certain);
}

void define_results(py::module_& m) {
  py::enum_<ChangeType>(m, "ChangeType")
      .value("ADDITION", ChangeType::kAddition)
      .value("REMOVAL", ChangeType::kRemoval)
      .value("RELOCATION", ChangeType::kRelocation);
  py::enum_<Side>(m, "Side").value("BEFORE", Side::kBefore).value("AFTER", Side::kAfter);
  py::class_<Component>(m, "Component", "Pixels of a mask that touch each other.")
      .def_readonly("label", &Component::label, "In the image of labels, from 1.")
      .def_readonly("area", &Component::area, "px")
      .def_readonly("u", &Component::u, "Centroid, px; the centre of the first pixel is 0.5.")
      .def_readonly("v", &Component::v);
  py::class_<PaperChange>(m, "PaperChange", "What the rule of GS-LTS says, and why.")
      .def_readonly("type", &PaperChange::type)
      .def_readonly("point_in_world", &PaperChange::point_in_world, "p_world, m.")
      .def_readonly("first", &PaperChange::first, "R_1")
      .def_readonly("second", &PaperChange::second, "R_2 of a relocation.");
  py::class_<Evidence>(m, "Evidence", "What tells an object that changed from an error.")
      .def_readonly("steps", &Evidence::steps,
                    "By which it is nearer, in units of the least that counts; if flat, of colour.")
      .def_readonly("differing", &Evidence::differing,
                    "Share of its pixels whose colours are not around in the other image.")
      .def_readonly("thickness_m", &Evidence::thickness_m, "Of the largest disc in it.")
      .def_readonly("attached", &Evidence::attached,
                    "Share of what is beside it whose depth goes on from it.")
      .def_readonly("unexplained", &Evidence::unexplained,
                    "Mean difference in colour that more or less light does not explain.")
      .def_readonly("correlation", &Evidence::correlation,
                    "Of the brightness of both images, on it and beside it.")
      .def_readonly("around_m", &Evidence::around_m, "Median difference of the depths around it.")
      .def_readonly("around_color", &Evidence::around_color,
                    "The difference in colour around it, as a share of that within.");
  py::class_<Sights>(m, "Sights", R"(How the places of a surface look from where a map was made.

Args:
    on: How often a frame saw a surface there,
    through: or looked through to something behind.
    seen: Share of the places of which there is either.)")
      .def(py::init([](double on, double through, double seen) {
             return Sights{on, through, seen};
           }),
           py::kw_only(), py::arg("on"), py::arg("through"), py::arg("seen"))
      .def_readonly("on", &Sights::on)
      .def_readonly("through", &Sights::through)
      .def_readonly("seen", &Sights::seen);
  py::class_<Surface>(m, "Surface", "The visible surface of an object, at one of the times.")
      .def_readonly("side", &Surface::side, "Seen in the map (BEFORE) or in the photo (AFTER).")
      .def_readonly("label", &Surface::label, "In the image of labels.")
      .def_readonly("area_px", &Surface::area_px)
      .def_readonly("area_m2", &Surface::area_m2, "Facing the camera.")
      .def_readonly("depth_m", &Surface::depth_m, "Its median.")
      .def_readonly("point", &Surface::point, "(3,) its median, in the world, m.")
      .def_readonly("low", &Surface::low, "(3,) corner of the box around most of it, world, m.")
      .def_readonly("high", &Surface::high)
      .def_readonly("color", &Surface::color, "(3,) median, sRGB.")
      .def_readonly("step_m", &Surface::step_m,
                    "By which it is nearer than what is seen at the other time.")
      .def_readonly("flat", &Surface::flat, "Whether colours alone tell of it.")
      .def_readonly("samples", &Surface::samples, "[N] points (3,) of it, in the world, m.")
      .def_readonly("evidence", &Surface::evidence)
      .def_readwrite("sights", &Surface::sights, "Of the samples; None if they are not known.");
  py::class_<ObjectChange>(m, "ObjectChange", "An object elsewhere, new or gone.")
      .def_readonly("type", &ObjectChange::type)
      .def_readonly("confidence", &ObjectChange::confidence, "0 to 1.")
      .def_readonly("before", &ObjectChange::before, "In the map; None for an addition.")
      .def_readonly("after", &ObjectChange::after, "In the photo; None for a removal.");
}

}  // namespace

void define_detect(py::module_ m) {
  define_rules(m);
  define_results(m);

  py::class_<OwnedViews>(m, "Views", R"(What a camera saw, and what a map shows from there.

Args:
    camera: Of all images.
    photo: [H,W,3] float32 sRGB, 0 to 1, as all others C-contiguous.
    rgb: [H,W,3] rendered, with the exposure of the photo.
    measured: [H,W] depth, z, m; 0 and NaN mean no measurement.
    rendered: [H,W] depth, z, m; 0 where nothing is.
    alpha: [H,W] opacity of the map, 0 to 1.
    similarity: [H,W] cosine of the features of both.

Raises:
    ValueError: An array does not fit.)")
      .def(py::init([](const Camera& camera, const py::array& photo, const py::array& rgb,
                       const py::array& measured, const py::array& rendered, const py::array& alpha,
                       const py::array& similarity) {
             return OwnedViews{views_of(camera, photo, rgb, measured, rendered, alpha, similarity),
                               py::make_tuple(photo, rgb, measured, rendered, alpha, similarity)};
           }),
           py::kw_only(), py::arg("camera"), py::arg("photo"), py::arg("rgb"), py::arg("measured"),
           py::arg("rendered"), py::arg("alpha"), py::arg("similarity"));

  py::class_<Masks>(m, "MaskSet", "Where both differ; see `masks_of`.");
  m.def(
      "masks_of",
      [](const OwnedViews& owned, const MaskRule& rule) {
        const py::gil_scoped_release release;
        return detect::masks_of(owned.views, rule);
      },
      py::arg("views"), py::arg("rule"), R"(The dual branch of GS-LTS, sec. III-C.

The paper prints M_feat = (similarity > tau_feat), which marks what did not change; here features
differ where their similarity is low.

Raises:
    ValueError: A setting is out of range.)");
  m.def(
      "arrays_of",
      [](const Masks& masks, const Camera& camera) {
        require_size(masks, camera);
        Arrays arrays;
        arrays["known"] = to_bools(Array<std::uint8_t>(masks.known), camera);
        arrays["pixel"] = to_bools(Array<std::uint8_t>(masks.pixel), camera);
        arrays["feature"] = to_bools(Array<std::uint8_t>(masks.feature), camera);
        arrays["combined"] = to_bools(Array<std::uint8_t>(masks.combined), camera);
        return arrays;
      },
      py::arg("masks"), py::arg("camera"),
      "[H,W] bool each: known, pixel (M_pixel), feature (M_feat) and combined (M_comb).");
  m.def(
      "paper_change",
      [](const OwnedViews& owned, const Masks& masks, const PaperRule& rule) {
        const Camera& camera = owned.views.camera;
        require_size(masks, camera);
        auto [components, change] = [&] {
          const py::gil_scoped_release release;
          auto parts = detect::components_of(masks.combined.data(), camera.width, camera.height);
          auto found = detect::paper_change(owned.views, parts, rule);
          return std::pair(std::move(parts), std::move(found));
        }();
        return std::pair(std::move(change),
                         to_numpy(std::move(components.labels), {camera.height, camera.width}));
      },
      py::arg("views"), py::arg("masks"), py::arg("rule"),
      R"(Change type and key point as printed in GS-LTS, sec. III-C.

Returns:
    The change, None if there is none, and the labels [H,W] int32 of the components.

Raises:
    ValueError: A setting is out of range.)");
  m.def(
      "changed_surfaces",
      [](const OwnedViews& owned, const Masks& masks, const ObjectRule& rule) {
        require_size(masks, owned.views.camera);
        detect::Surfaces found = [&] {
          const py::gil_scoped_release release;
          return detect::changed_surfaces(owned.views, masks, rule);
        }();
        const Camera& camera = owned.views.camera;
        return std::pair(std::move(found.surfaces),
                         to_numpy(std::move(found.labels), {camera.height, camera.width}));
      },
      py::arg("views"), py::arg("masks"), py::arg("rule"),
      R"(What only one of map and photo shows.

Returns:
    The surfaces, and the image [H,W] int32 of their labels; 0 where nothing changed.

Raises:
    ValueError: A setting is out of range.)");
  m.def("changes_of", &detect::changes_of, py::arg("surfaces"), py::arg("rule"),
        R"(The changes that explain some surfaces, the most certain first.

What vanished and what appeared are one object if they are alike in colours and size.

Raises:
    ValueError: A setting is out of range.)");
  m.def("certainty", &detect::certainty, py::arg("surface"),
        "0 to 1: how likely a surface is that of an object that changed.");
  m.def("features_of", &detect::features_of, py::arg("surface"), "What `certainty` weighs.");
  m.def("likeness", &detect::likeness, py::arg("a"), py::arg("b"),
        "0 to 1: how likely two surfaces are one object, both answers being as likely beforehand.");
  m.def("differences_of", &detect::differences_of, py::arg("a"), py::arg("b"),
        "What `likeness` weighs: how far histograms of colours, and areas, are apart.");
}

}  // namespace gslts::python
