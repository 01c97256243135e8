#include <pybind11/pybind11.h>

#include "gslts/detect/gs_lts_rule.hpp"
#include "gslts/detect/masks.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::python {
namespace {

namespace py = pybind11;
using detect::GsLtsRule;
using detect::MaskRule;
using detect::ObjectRule;

void define_mask_rule(py::module_& m) {
  const MaskRule rule;
  py::class_<MaskRule>(m, "MaskRule", R"(Thresholds of the masks of GS-LTS, sec. III-C1; immutable.

Args:
    tau_gs: Sum over the channels of absolute colour differences above which a pixel differs, 0 to 3.
    tau_feat: Cosine of the features below which a pixel differs, -1 to 1.
    alpha_min: Minimum opacity of the map where it is known, 0 to 1.
    clean_px: Radius of the opening and closing of the combined mask, px.)")
      .def(py::init([](double tau_gs, double tau_feat, double alpha_min, int clean_px) {
             return MaskRule{tau_gs, tau_feat, alpha_min, clean_px};
           }),
           py::kw_only(), py::arg("tau_gs") = rule.tau_gs, py::arg("tau_feat") = rule.tau_feat,
           py::arg("alpha_min") = rule.alpha_min, py::arg("clean_px").noconvert() = rule.clean_px)
      .def_readonly("tau_gs", &MaskRule::tau_gs)
      .def_readonly("tau_feat", &MaskRule::tau_feat)
      .def_readonly("alpha_min", &MaskRule::alpha_min)
      .def_readonly("clean_px", &MaskRule::clean_px);
}

void define_gs_lts_rule(py::module_& m) {
  const GsLtsRule rule;
  py::class_<GsLtsRule>(m, "GsLtsRule",
                        R"(Thresholds of the rule of GS-LTS, sec. III-C2; immutable.

Args:
    tau_change: Share of the image that M_comb must exceed, 0 to 1.
    tau_a: Minimum area similarity of a relocation's two regions, 0 to 1.
    tau_d: Maximum distance of a relocation's two regions, as a share of the image's width.
    epsilon: Minimum depth difference of an addition or a removal, m.)")
      .def(py::init([](double tau_change, double tau_a, double tau_d, double epsilon) {
             return GsLtsRule{tau_change, tau_a, tau_d, epsilon};
           }),
           py::kw_only(), py::arg("tau_change") = rule.tau_change, py::arg("tau_a") = rule.tau_a,
           py::arg("tau_d") = rule.tau_d, py::arg("epsilon") = rule.epsilon)
      .def_readonly("tau_change", &GsLtsRule::tau_change)
      .def_readonly("tau_a", &GsLtsRule::tau_a)
      .def_readonly("tau_d", &GsLtsRule::tau_d)
      .def_readonly("epsilon", &GsLtsRule::epsilon);
}

constexpr const char* kObjectRuleDoc =
    R"(Thresholds that separate objects that changed from errors of sensor, pose and map; immutable.

A surface counts as nearer than that of the other image if it is so by `step_sigmas` standard
deviations of the depth, the constant part measured across the surface, plus the change of its depth
within `step_px` pixels.

Args:
    step_sigmas: Minimum step, in standard deviations, above 0.
    step_px: Part for the slope of the surface, px.
    edge_tolerance_px: By which edges may be misplaced, px.
    min_area_m2: Minimum area of a surface, facing the camera, m^2.
    min_area_px: Minimum area of a part of a surface, px.
    min_flat_area_m2: Minimum area of a flat change (colours changed, but no single pixel's depth),
        m^2.
    min_flat_color: Minimum colour change of a flat change, summed over the channels, above 0 to 3.
    min_flat_step_m: Minimum median depth difference that tells the side of a flat change, m.
    min_flat_contrast: Minimum difference of the brightness gradient across the outline of a flat
        change, 1/px.
    min_match_score: Minimum `match_score` of the two ends of a relocation, 0 to 1.
    min_confidence: Minimum confidence of a reported change, 0 to 1.)";

void define_object_rule(py::module_& m) {
  const ObjectRule rule;
  py::class_<ObjectRule>(m, "ObjectRule", kObjectRuleDoc)
      .def(py::init([](double step_sigmas, double step_px, int edge_tolerance_px,
                       double min_area_m2, int min_area_px, double min_flat_area_m2,
                       double min_flat_color, double min_flat_step_m, double min_flat_contrast,
                       double min_match_score, double min_confidence) {
             return ObjectRule{step_sigmas,     step_px,         edge_tolerance_px,
                               min_area_m2,     min_area_px,     min_flat_area_m2,
                               min_flat_color,  min_flat_step_m, min_flat_contrast,
                               min_match_score, min_confidence};
           }),
           py::kw_only(), py::arg("step_sigmas") = rule.step_sigmas,
           py::arg("step_px") = rule.step_px,
           py::arg("edge_tolerance_px").noconvert() = rule.edge_tolerance_px,
           py::arg("min_area_m2") = rule.min_area_m2,
           py::arg("min_area_px").noconvert() = rule.min_area_px,
           py::arg("min_flat_area_m2") = rule.min_flat_area_m2,
           py::arg("min_flat_color") = rule.min_flat_color,
           py::arg("min_flat_step_m") = rule.min_flat_step_m,
           py::arg("min_flat_contrast") = rule.min_flat_contrast,
           py::arg("min_match_score") = rule.min_match_score,
           py::arg("min_confidence") = rule.min_confidence)
      .def_readonly("step_sigmas", &ObjectRule::step_sigmas)
      .def_readonly("step_px", &ObjectRule::step_px)
      .def_readonly("edge_tolerance_px", &ObjectRule::edge_tolerance_px)
      .def_readonly("min_area_m2", &ObjectRule::min_area_m2)
      .def_readonly("min_area_px", &ObjectRule::min_area_px)
      .def_readonly("min_flat_area_m2", &ObjectRule::min_flat_area_m2)
      .def_readonly("min_flat_color", &ObjectRule::min_flat_color)
      .def_readonly("min_flat_step_m", &ObjectRule::min_flat_step_m)
      .def_readonly("min_flat_contrast", &ObjectRule::min_flat_contrast)
      .def_readonly("min_match_score", &ObjectRule::min_match_score)
      .def_readonly("min_confidence", &ObjectRule::min_confidence);
}

}  // namespace

void define_detect_rules(py::module_ m) {
  define_mask_rule(m);
  define_gs_lts_rule(m);
  define_object_rule(m);
}

}  // namespace gslts::python
