#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <utility>
#include <vector>

#include "gslts/detect/components.hpp"
#include "gslts/detect/gs_lts_rule.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/regions.hpp"
#include "gslts/detect/shifts.hpp"
#include "gslts/detect/surface.hpp"

namespace gslts::python {
namespace {

namespace py = pybind11;
using detect::ChangeType;
using detect::Component;
using detect::Evidence;
using detect::GsLtsChange;
using detect::ObjectChange;
using detect::Side;
using detect::Surface;
using detect::Visibility;
using Eigen::Vector3d;

template <typename Value>
Value checked(Value value, const char* function) {
  validate(value, function);
  return value;
}

void define_evidence(py::module_& m) {
  const Evidence none;
  py::class_<Evidence>(
      m, "Evidence",
      R"(Measurements that tell an object that changed from an error of sensor, pose or map; immutable.

Args:
    step_ratio: Median step by which the surface is nearer than that of the other image, in units of
        the smallest that counts; of a flat surface its mean colour change in such units.
    changed_share: Share of its pixels whose colours are not around in the other image.
    thickness_m: Diameter of the largest disc in it, m.
    attached_share: Share of the pixels beside it in which its depth continues.
    residual_color: Mean colour change, summed over the channels, that more or less light does not
        explain.
    correlation: Of the brightness of both images, on it and beside it, -1 to 1.
    ring_depth_m: Median absolute difference of the depths around it, m.
    ring_color_ratio: Colour change around it, as a share of that on it.
    depth_error_m: Mean expected error of the rendered depth, m.
    color_error: Mean expected error of the rendered colour, summed over the channels.

Raises:
    ValueError: A number is not finite, a share is not in 0 to 1, or another one but the correlation
        is negative.)")
      .def(py::init([](double step_ratio, double changed_share, double thickness_m,
                       double attached_share, double residual_color, double correlation,
                       double ring_depth_m, double ring_color_ratio, double depth_error_m,
                       double color_error) {
             return checked(
                 Evidence{step_ratio, changed_share, thickness_m, attached_share, residual_color,
                          correlation, ring_depth_m, ring_color_ratio, depth_error_m, color_error},
                 "Evidence");
           }),
           py::kw_only(), py::arg("step_ratio") = none.step_ratio,
           py::arg("changed_share") = none.changed_share, py::arg("thickness_m") = none.thickness_m,
           py::arg("attached_share") = none.attached_share,
           py::arg("residual_color") = none.residual_color,
           py::arg("correlation") = none.correlation, py::arg("ring_depth_m") = none.ring_depth_m,
           py::arg("ring_color_ratio") = none.ring_color_ratio,
           py::arg("depth_error_m") = none.depth_error_m, py::arg("color_error") = none.color_error)
      .def_readonly("step_ratio", &Evidence::step_ratio)
      .def_readonly("changed_share", &Evidence::changed_share)
      .def_readonly("thickness_m", &Evidence::thickness_m)
      .def_readonly("attached_share", &Evidence::attached_share)
      .def_readonly("residual_color", &Evidence::residual_color)
      .def_readonly("correlation", &Evidence::correlation)
      .def_readonly("ring_depth_m", &Evidence::ring_depth_m)
      .def_readonly("ring_color_ratio", &Evidence::ring_color_ratio)
      .def_readonly("depth_error_m", &Evidence::depth_error_m)
      .def_readonly("color_error", &Evidence::color_error);
}

void define_visibility(py::module_& m) {
  py::class_<Visibility>(m, "Visibility", R"(Visibility counts of a surface's samples; immutable.

In how many training cameras of the map each sample is seen, summed over the samples.

Args:
    on_surface: Counts of cameras that see a surface at the sample.
    seen_through: Counts of cameras that see a surface behind it: the sample was free space.
    known_share: Share of the samples with at least one count, 0 to 1.
    recorded_share: Share of the samples at which the recording of the map measured a surface.
    free_share: Share of the samples that the recording saw through.
    missing_share: Of a surface of the map, share of the samples that the recording saw through
        and never measured.

Raises:
    ValueError: A count is negative or not finite, or a share is not in 0 to 1.)")
      .def(py::init([](double on_surface, double seen_through, double known_share,
                       double recorded_share, double free_share, double missing_share) {
             return checked(Visibility{on_surface, seen_through, known_share, recorded_share,
                                       free_share, missing_share},
                            "Visibility");
           }),
           py::kw_only(), py::arg("on_surface"), py::arg("seen_through"), py::arg("known_share"),
           py::arg("recorded_share") = 0.0, py::arg("free_share") = 1.0,
           py::arg("missing_share") = 0.0)
      .def_readonly("on_surface", &Visibility::on_surface)
      .def_readonly("seen_through", &Visibility::seen_through)
      .def_readonly("known_share", &Visibility::known_share)
      .def_readonly("recorded_share", &Visibility::recorded_share)
      .def_readonly("free_share", &Visibility::free_share)
      .def_readonly("missing_share", &Visibility::missing_share);
}

constexpr const char* kSurfaceDoc = R"(The visible surface of an object, before or after a change.

`find_changed_surfaces` returns surfaces; a detector of your own builds them. `side`, `point`, `low`
and `high` say what changed and where; the rest serves `confidence` and `match_score`.

Args:
    side: In which image it is seen: in the map (BEFORE) or in the frame (AFTER).
    point: (3,) float64, median of its points, world, m.
    low: (3,) float64, lower corner of the box around most of it, world, m.
    high: (3,) float64, upper corner.
    label: In the image of labels; 0: in none.
    area_px: Pixels.
    area_m2: Area facing the camera, m^2.
    depth_m: Median z in the camera frame, m.
    color: (3,) float64, median, sRGB, 0 to 1.
    step_m: Median step by which it is nearer than in the other image, m.
    flat: It is a flat change: colours changed, but no single pixel's depth.
    samples: [N] points (3,) of it, world, m.
    color_histogram: Shares of colours that sum up to 1; empty: unknown, and it matches nothing.
    evidence: Measurements on and around it; None: those of `Evidence()`.
    visibility: Visibility counts of the samples; None: unknown.
    color_confidence: Confidence of a region of colours, 0 to 1, in place of that from the rest; None:
        not known.

Raises:
    ValueError: A number is not finite, an area or a depth is negative, the box is inverted, the
        histogram has another length or sum, or the confidence is not in 0 to 1.)";

Surface make_surface(Side side, const Vector3d& point, const Vector3d& low, const Vector3d& high,
                     int label, int area_px, double area_m2, double depth_m, const Vector3d& color,
                     double step_m, bool flat, std::vector<Vector3d> samples,
                     std::vector<float> color_histogram, const std::optional<Evidence>& evidence,
                     const std::optional<Visibility>& visibility,
                     std::optional<double> color_confidence) {
  return checked(Surface{side, label, area_px, area_m2, depth_m, point, low, high, color, step_m,
                         flat, std::move(samples), std::move(color_histogram),
                         evidence.value_or(Evidence{}), visibility, color_confidence},
                 "Surface");
}

void set_color_confidence(Surface& surface, std::optional<double> confidence) {
  Surface only_confidence;
  only_confidence.color_confidence = confidence;
  validate(only_confidence, "Surface");
  surface.color_confidence = confidence;
}

void define_surface(py::module_& m) {
  const Surface none;
  py::class_<Surface>(m, "Surface", kSurfaceDoc)
      .def(py::init(&make_surface), py::kw_only(), py::arg("side"), py::arg("point"),
           py::arg("low"), py::arg("high"), py::arg("label").noconvert() = none.label,
           py::arg("area_px").noconvert() = none.area_px, py::arg("area_m2") = none.area_m2,
           py::arg("depth_m") = none.depth_m, py::arg("color") = py::make_tuple(0.0, 0.0, 0.0),
           py::arg("step_m") = none.step_m, py::arg("flat") = none.flat,
           py::arg("samples") = py::tuple(), py::arg("color_histogram") = py::tuple(),
           py::arg("evidence") = py::none(), py::arg("visibility") = py::none(),
           py::arg("color_confidence") = py::none())
      .def_readonly("side", &Surface::side)
      .def_readonly("label", &Surface::label)
      .def_readonly("area_px", &Surface::area_px)
      .def_readonly("area_m2", &Surface::area_m2)
      .def_readonly("depth_m", &Surface::depth_m)
      .def_readonly("point", &Surface::point)
      .def_readonly("low", &Surface::low)
      .def_readonly("high", &Surface::high)
      .def_readonly("color", &Surface::color)
      .def_readonly("step_m", &Surface::step_m)
      .def_readonly("flat", &Surface::flat)
      .def_readonly("samples", &Surface::samples)
      .def_readonly("color_histogram", &Surface::color_histogram)
      .def_readonly("evidence", &Surface::evidence)
      .def_property(
          "color_confidence", [](const Surface& surface) { return surface.color_confidence; },
          &set_color_confidence, "May be set: what updates added is not known to the detection.")
      .def_readwrite("visibility", &Surface::visibility,
                     "May be set: the map's training cameras are not known to the detection.");
}

std::pair<Vector3d, Vector3d> corners_of(const Eigen::AlignedBox3d& box) {
  return {box.min(), box.max()};
}

void define_shift(py::module_& m) {
  using detect::Shift;
  py::class_<Shift>(m, "Shift", "A small rigid motion over the floor.")
      .def_readonly("surfaces", &Shift::surfaces, "Rows of the surfaces that it explains.")
      .def_property_readonly(
          "motion", [](const Shift& shift) { return Eigen::Matrix4d(shift.motion.matrix()); },
          "[4,4] float64, world, m: x_after = motion @ x_before.")
      .def_readonly("score", &Shift::score,
                    "Mean share of their points that it explains, less those that contradict it.")
      .def_property_readonly(
          "before", [](const Shift& shift) { return corners_of(shift.before); },
          "Lower and upper corner (3,) around the points that were followed, world, m.")
      .def_property_readonly(
          "after", [](const Shift& shift) { return corners_of(shift.after); },
          "The same after the motion.");
}

void define_changes(py::module_& m) {
  py::class_<detect::Region>(m, "Region",
                             "A region of similar colours that the other image may not show.")
      .def_readonly("side", &detect::Region::side)
      .def_readonly("pixels", &detect::Region::pixels, "Indices, row by row.")
      .def_readonly("features", &detect::Region::features,
                    "Features of the logistic regression of its confidence.");
  py::class_<Component>(m, "Component", "Pixels of a mask that touch each other.")
      .def_readonly("label", &Component::label, "In the image of labels, from 1.")
      .def_readonly("area", &Component::area, "Pixels.")
      .def_readonly("u", &Component::u,
                    "Column of the centroid, px; the centre of the first pixel is 0.5.")
      .def_readonly("v", &Component::v, "Row of the centroid, px.");
  py::class_<GsLtsChange>(m, "GsLtsChange", "A change as the rule of GS-LTS finds it.")
      .def_readonly("type", &GsLtsChange::type)
      .def_readonly("point_in_world", &GsLtsChange::point_in_world, "(3,) p_world, m.")
      .def_readonly("first", &GsLtsChange::first, "R_1.")
      .def_readonly("second", &GsLtsChange::second, "R_2 of a relocation, else None.");
  py::class_<ObjectChange>(m, "ObjectChange", "An object that was added, removed or relocated.")
      .def_readonly("type", &ObjectChange::type)
      .def_readonly("confidence", &ObjectChange::confidence, "0 to 1.")
      .def_readonly("before", &ObjectChange::before, "In the map; None for an addition.")
      .def_readonly("after", &ObjectChange::after, "In the frame; None for a removal.");
}

}  // namespace

void define_detect_values(py::module_ m) {
  py::enum_<ChangeType>(m, "ChangeType")
      .value("ADDITION", ChangeType::kAddition)
      .value("REMOVAL", ChangeType::kRemoval)
      .value("RELOCATION", ChangeType::kRelocation);
  py::enum_<Side>(m, "Side").value("BEFORE", Side::kBefore).value("AFTER", Side::kAfter);
  define_evidence(m);
  define_visibility(m);
  define_surface(m);
  define_shift(m);
  define_changes(m);
}

}  // namespace gslts::python
