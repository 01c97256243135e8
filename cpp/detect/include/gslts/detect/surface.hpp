#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace gslts::detect {

enum class Side { kBefore, kAfter };

/// What tells an object that changed from an error of sensor, pose or map.
struct Evidence {
  /// By which it is nearer than what is seen at the other time, in units of the least that counts;
  /// if flat, its difference in colour in such units.
  double steps = 0;
  double differing = 0;    ///< Share of its pixels whose colours are not around in the other image.
  double thickness_m = 0;  ///< Diameter of the largest disc in it.
  double attached = 0;     ///< Share of what is beside it whose depth goes on from it.
  /// Mean difference in colour, summed over the channels, that more or less light does not explain.
  double unexplained = 0;
  /// Of the brightness of both images, on it and beside it: one surface looks alike in any light.
  double correlation = 0;
  double around_m = 0;      ///< Median difference of the depths around it.
  double around_color = 0;  ///< The difference in colour around it, as a share of that within.
};

/// How the places of a surface look from where the frames of the map were taken.
struct Sights {
  double on = 0;       ///< How often one saw a surface there,
  double through = 0;  ///< or looked through to something behind.
  double seen = 1;     ///< Share of the places of which there is either.
};

/// The visible surface of an object, at one of the times.
struct Surface {
  Side side = Side::kBefore;  ///< Seen in the map (before) or in the photo (after).
  int label = 0;              ///< In the image of labels.
  int area_px = 0;            ///< Pixels.
  double area_m2 = 0;         ///< Facing the camera.
  double depth_m = 0;         ///< Its median.
  /// Its median, in the world, m.
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  /// Corners of the box around most of it, in the world, m.
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();  ///< Median, sRGB.
  double step_m = 0;  ///< By which it is nearer than what is seen at the other time.
  bool flat = false;  ///< Whether colours alone tell of it.
  std::vector<Eigen::Vector3d> samples;  ///< Some of its points, in the world, m.
  std::vector<float> colors;             ///< Histogram of its colours: `color_histogram`.
  Evidence evidence;
  std::optional<Sights> sights;  ///< Of the samples, where they are known.
};

inline constexpr std::size_t kFeatures = 15;

/// What `certainty` weighs.
std::array<double, kFeatures> features_of(const Surface& surface);

/// 0 to 1: how likely a surface is that of an object that changed.
///
/// Logistic regression over surfaces found in simulated homes: benchmarks/results/detection.md.
double certainty(const Surface& surface);

/// What `likeness` weighs: how far histograms and areas are apart.
std::array<double, 2> differences_of(const Surface& a, const Surface& b);

/// 0 to 1: how likely two surfaces are one object, where both answers are as likely beforehand.
///
/// Logistic regression like `certainty`. Parts of either may be hidden.
double likeness(const Surface& a, const Surface& b);

}  // namespace gslts::detect
