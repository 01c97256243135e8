#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace gslts::detect {

/// In which of the two images a surface is seen: in the map (before) or in the frame (after).
enum class Side { kBefore, kAfter };

/// Measurements that tell an object that changed from an error of the sensor, the pose or the map.
struct Evidence {
  /// Median step by which the surface is nearer than that of the other image, in units of the
  /// smallest that counts; of a flat surface its mean colour change in such units.
  double step_ratio = 0;
  /// Share of its pixels whose colours do not occur around it in the other image.
  double changed_share = 0;
  double thickness_m = 0;     ///< Diameter of the largest disc in it, m.
  double attached_share = 0;  ///< Share of the pixels beside it in which its depth continues.
  /// Mean colour change, summed over the channels, that more or less light does not explain.
  double residual_color = 0;
  double correlation = 0;   ///< Correlation of both brightness images, on and beside it, -1 to 1.
  double ring_depth_m = 0;  ///< Median absolute difference of the depths around it, m.
  double ring_color_ratio = 0;   ///< Colour change around it, as a share of that on it.
  double depth_error_m = 0.012;  ///< Mean expected error of the rendered depth, m.
  double color_error = 0.05;     ///< Mean expected error of the rendered colour, over the channels.
};

/// Visibility counts of the sampled points of a surface: in how many training cameras of the map
/// each is seen, summed over the points.
struct Visibility {
  double on_surface = 0;      ///< The camera sees a surface at the point,
  double seen_through = 0;    ///< or a surface behind it: the point was free.
  double known_share = 1;     ///< Share of the points with at least one count.
  double recorded_share = 0;  ///< Share of the points at which the map's recording has a surface.
  double free_share = 1;      ///< Share of the points that the recording saw through.
  double missing_share = 0;   ///< Share of those, of a map's surface, that it never measured.
};

/// The visible surface of an object, before or after a change.
///
/// Side, point and box say what changed and where; the rest serves `confidence` and `match_score`.
struct Surface {
  Side side = Side::kBefore;
  int label = 0;                                    ///< In the image of labels; 0: in none.
  int area_px = 0;                                  ///< px
  double area_m2 = 0;                               ///< Facing the camera, m^2.
  double depth_m = 0;                               ///< Median z in the camera frame, m.
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< Median, world, m.
  /// Corners of the box around most of it, world, m.
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();  ///< Median, sRGB, 0 to 1.
  double step_m = 0;  ///< Median step by which it is nearer than in the other image, m.
  bool flat = false;  ///< It is a flat change: colours changed, but no single pixel's depth.
  std::vector<Eigen::Vector3d> samples;  ///< Some of its points, world, m.
  std::vector<float> color_histogram;    ///< Shares of colours that sum up to 1; empty: unknown.
  Evidence evidence;
  std::optional<Visibility> visibility;  ///< Counts of the samples, if they are known.
  /// Confidence from colours alone (`find_changed_regions`); it then is the surface's.
  std::optional<double> color_confidence;
};

/// Checks measurements that did not come from `find_changed_surfaces`, and counts.
/// @throws std::invalid_argument  naming the function, if a number is not finite, a share is not in
///   [0, 1], or another number but the correlation is negative.
void validate(const Evidence& evidence, const char* function);
void validate(const Visibility& visibility, const char* function);

/// Checks a surface, with its evidence and visibility.
/// @throws std::invalid_argument  naming the function, if a number is not finite, an area or a
///   depth is negative, the box is inverted, the histogram has another length or sum, or the
///   confidence of colours is not in [0, 1].
void validate(const Surface& surface, const char* function);

/// Number of the numbers that `confidence` weighs.
inline constexpr std::size_t kConfidenceFeatures = 18;

/// Computes the numbers that `confidence` weighs, in the order of `kConfidenceWeights`.
std::array<double, kConfidenceFeatures> confidence_features(const Surface& surface);

/// Returns how likely a surface belongs to an object that changed, 0 to 1.
///
/// Logistic regression over surfaces found in simulated homes: benchmarks/results/detection.md.
double confidence(const Surface& surface);

/// Computes the numbers that `match_score` weighs: the distance of the colour histograms
/// (Hellinger), and the logarithm of the ratio of the heights after and before; 0 if it is smaller.
std::array<double, 2> match_features(const Surface& before, const Surface& after);

/// Returns how likely two surfaces of one pair of images are one object, 0 to 1.
///
/// Logistic regression like `confidence`. Parts of either may be hidden.
double match_score(const Surface& before, const Surface& after);

}  // namespace gslts::detect
