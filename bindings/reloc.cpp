#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "gslts/reloc/hypotheses.hpp"
#include "poses.hpp"

namespace gslts::python {
namespace {

using reloc::FeatureRule;
using reloc::Features;
using reloc::Hypothesis;
using reloc::HypothesisRule;
using reloc::kDescriptorBytes;
using reloc::LandmarkIndex;
using reloc::Matches;

/// Columns of an array of descriptors.
constexpr py::ssize_t kBytes = kDescriptorBytes;

py::typing::Tuple<py::array_t<float>, py::array_t<std::uint8_t>> features_of(
    const py::array& grey, const std::optional<py::array>& mask, const FeatureRule& rule) {
  const auto* pixels = require_array<std::uint8_t>(grey, "grey", {kAnyLength, kAnyLength});
  const py::ssize_t height = grey.shape(0), width = grey.shape(1);
  const bool* wanted = mask ? require_array<bool>(*mask, "mask", {height, width}) : nullptr;
  Features features = [&] {
    const py::gil_scoped_release release;
    return reloc::features_of(pixels, int(width), int(height),
                              reinterpret_cast<const std::uint8_t*>(wanted), rule);
  }();
  const auto count = py::ssize_t(features.size());
  return py::make_tuple(to_numpy(std::move(features.pixels), {count, 2}),
                        to_numpy(std::move(features.descriptors), {count, kBytes}));
}

LandmarkIndex make_index(const py::array& positions, const py::array& descriptors,
                         const py::array& keyframes) {
  reloc::LandmarksView landmarks;
  landmarks.positions = require_array<float>(positions, "positions", {kAnyLength, 3});
  const py::ssize_t count = positions.shape(0);
  landmarks.size = std::size_t(count);
  landmarks.descriptors = require_array<std::uint8_t>(descriptors, "descriptors", {count, kBytes});
  landmarks.keyframes = require_array<std::int32_t>(keyframes, "keyframes", {count});
  const py::gil_scoped_release release;
  return LandmarkIndex(landmarks);
}

template <typename T>
Array<T> copy_of(const T* elements, py::ssize_t count) {
  return Array<T>(elements, elements + count);
}

/// Features whose pixels are not used: all at (0, 0).
Features features_from(const py::array& descriptors) {
  const auto* bytes = require_array<std::uint8_t>(descriptors, "descriptors", {kAnyLength, kBytes});
  const py::ssize_t count = descriptors.shape(0);
  return {Array<float>(2 * std::size_t(count), 0.0f), copy_of(bytes, count * kBytes)};
}

py::typing::Tuple<py::array_t<std::int32_t>, py::array_t<std::int32_t>> match(
    const LandmarkIndex& index, const py::array& descriptors, int k) {
  const Features features = features_from(descriptors);
  Matches matches = [&] {
    const py::gil_scoped_release release;
    return index.match(features, k);
  }();
  const py::ssize_t count = descriptors.shape(0);
  return py::make_tuple(to_numpy(std::move(matches.landmarks), {count, k}),
                        to_numpy(std::move(matches.distances), {count, k}));
}

std::vector<Hypothesis> hypotheses_of(const Camera& camera, const py::array& pixels,
                                      const py::array& descriptors, const py::array& depths,
                                      const LandmarkIndex& index, const HypothesisRule& rule) {
  Features features = features_from(descriptors);
  const py::ssize_t count = descriptors.shape(0);
  features.pixels = copy_of(require_array<float>(pixels, "pixels", {count, 2}), 2 * count);
  const auto* measured = require_array<float>(depths, "depths", {count});
  const py::gil_scoped_release release;
  return reloc::hypotheses_of(camera, features, measured, index, rule);
}

void define_feature_rule(py::module_& m) {
  const FeatureRule rule;
  py::class_<FeatureRule>(m, "FeatureRule", R"(Settings of feature extraction.

Args:
    count: Maximum number of features, spread over the image.
    scale_step: Ratio of the sizes of neighbouring levels of the pyramid, above 1.
    levels: Number of levels of the pyramid, 1 to 16.
    fast_threshold: Minimum grey difference of a FAST corner, 1 to 254.)")
      .def(py::init([](int count, double scale_step, int levels, int fast_threshold) {
             return FeatureRule{count, scale_step, levels, fast_threshold};
           }),
           py::kw_only(), py::arg("count").noconvert() = rule.count,
           py::arg("scale_step") = rule.scale_step, py::arg("levels").noconvert() = rule.levels,
           py::arg("fast_threshold").noconvert() = rule.fast_threshold)
      .def_readonly("count", &FeatureRule::count)
      .def_readonly("scale_step", &FeatureRule::scale_step)
      .def_readonly("levels", &FeatureRule::levels)
      .def_readonly("fast_threshold", &FeatureRule::fast_threshold);
}

void define_hypothesis_rule(py::module_& m) {
  const HypothesisRule rule;
  py::class_<HypothesisRule>(m, "HypothesisRule", R"(Settings of the search for hypotheses.

Args:
    neighbours: Landmarks that are considered for each feature, 1 to 16.
    max_bits: Maximum Hamming distance of a match, 0 to 256.
    ratio: Maximum ratio of the distances to the nearest landmark and to the next one elsewhere, for
        matches among all landmarks, above 0 and at most 1.
    same_landmark_m: Landmarks that are nearer to each other count as one, m.
    keyframes: Number of keyframes that are tried one by one, by votes.
    inlier_px: Maximum reprojection error of an inlier, px.
    inlier_depth: Maximum relative error of its measured depth.
    min_inliers: Minimum number of inliers of a hypothesis, at least 4.
    iterations: Maximum number of poses that each RANSAC tries.)")
      .def(py::init([](int neighbours, int max_bits, double ratio, double same_landmark_m,
                       int keyframes, double inlier_px, double inlier_depth, int min_inliers,
                       int iterations) {
             return HypothesisRule{neighbours,      max_bits,    ratio,
                                   same_landmark_m, keyframes,   inlier_px,
                                   inlier_depth,    min_inliers, iterations};
           }),
           py::kw_only(), py::arg("neighbours").noconvert() = rule.neighbours,
           py::arg("max_bits").noconvert() = rule.max_bits, py::arg("ratio") = rule.ratio,
           py::arg("same_landmark_m") = rule.same_landmark_m,
           py::arg("keyframes").noconvert() = rule.keyframes, py::arg("inlier_px") = rule.inlier_px,
           py::arg("inlier_depth") = rule.inlier_depth,
           py::arg("min_inliers").noconvert() = rule.min_inliers,
           py::arg("iterations").noconvert() = rule.iterations)
      .def_readonly("neighbours", &HypothesisRule::neighbours)
      .def_readonly("max_bits", &HypothesisRule::max_bits)
      .def_readonly("ratio", &HypothesisRule::ratio)
      .def_readonly("same_landmark_m", &HypothesisRule::same_landmark_m)
      .def_readonly("keyframes", &HypothesisRule::keyframes)
      .def_readonly("inlier_px", &HypothesisRule::inlier_px)
      .def_readonly("inlier_depth", &HypothesisRule::inlier_depth)
      .def_readonly("min_inliers", &HypothesisRule::min_inliers)
      .def_readonly("iterations", &HypothesisRule::iterations);
}

void define_landmark_index(py::module_& m) {
  py::class_<LandmarkIndex>(
      m, "LandmarkIndex", R"(Approximate nearest-neighbour index of landmarks, by their descriptors.

It keeps a copy of the landmarks; the same landmarks give the same index.

Args:
    positions: [L,3] float32 from the map's origin, m.
    descriptors: [L,32] uint8, ORB.
    keyframes: [L] int32, index of the keyframe that saw each.

Raises:
    ValueError: A position is not finite, a keyframe is negative, or an array does not fit.

Source: FLANN's multi-probe locality-sensitive hashing (Lv et al. 2007).)")
      .def(py::init(&make_index), py::arg("positions"), py::arg("descriptors"),
           py::arg("keyframes"))
      .def("__len__", [](const LandmarkIndex& index) { return index.landmarks().size; })
      .def("match", &match, py::arg("descriptors"), py::arg("k").noconvert(),
           R"(Find the nearest landmarks of each of M features.

Args:
    descriptors: [M,32] uint8 of the features.
    k: Number of landmarks per feature, 1 to 16.

Returns:
    landmarks: [M,k] int32 rows, the nearest first; -1 where fewer were found.
    distances: [M,k] int32, Hamming distance in bits; 256 where fewer were found.

Raises:
    ValueError: k is out of range, or the array does not fit.)");
}

void define_hypothesis(py::module_& m) {
  py::class_<Hypothesis>(m, "Hypothesis", "A pose that some features support.")
      .def_property_readonly(
          "world_from_camera",
          [](const Hypothesis& hypothesis) { return to_numpy(hypothesis.world_from_camera); },
          "[4,4] float64, a copy.")
      .def_readonly("inliers", &Hypothesis::inliers, "Number of keypoints that it explains.")
      .def_readonly("keyframe", &Hypothesis::keyframe,
                    "Index of the keyframe whose landmarks gave it; -1 for all landmarks.");
}

}  // namespace

void define_reloc(py::module_ m) {
  define_feature_rule(m);
  define_hypothesis_rule(m);
  define_landmark_index(m);
  define_hypothesis(m);
  m.def("features_of", &features_of, py::arg("grey"), py::arg("mask"), py::arg("rule"),
        R"(Extract keypoints with descriptors, the strongest of each part of an image.

Args:
    grey: [H,W] uint8.
    mask: [H,W] bool, True where features are wanted. None: everywhere.
    rule: Settings.

Returns:
    pixels: [M,2] float32, (u, v); pixel centres are at + 0.5.
    descriptors: [M,32] uint8, ORB.

Raises:
    ValueError: An array does not fit, or the rule is out of range.

Source: Rublee et al. 2011, ORB; spread as in Mur-Artal et al. 2015, ORB-SLAM.)");
  m.def("hypotheses_of", &hypotheses_of, py::arg("camera"), py::arg("pixels"),
        py::arg("descriptors"), py::arg("depths"), py::arg("index"), py::arg("rule"),
        R"(Find poses from which an image may have been taken.

Args:
    camera: Intrinsics of the image; its pose is not used.
    pixels: [M,2] float32, positions of its features, px.
    descriptors: [M,32] uint8 of the features.
    depths: [M] float32, z of the features, m; 0 and NaN mean no measurement.
    index: Landmarks of the map.
    rule: Settings.

Returns:
    Hypotheses by descending number of inliers, without poses within 5 cm and 3 degrees of each
    other.

Raises:
    ValueError: An array does not fit, a pixel is not finite, or the rule is out of range.

Source: RANSAC with three points (Umeyama 1991) where depth is measured, P3P (Gao et al. 2003)
elsewhere.)");
}

}  // namespace gslts::python
