#include "gslts/reloc/features.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "gslts/map/require.hpp"

namespace gslts::reloc {
namespace {

using KeyPoints = std::vector<cv::KeyPoint>;

/// Name in messages.
constexpr const char* kFunction = "features_of";

/// Radius of the patch whose centroid gives the orientation of a keypoint, px (Rublee et al. 2011).
constexpr int kPatch_px = 15;
/// Distance of keypoints from the edge of the image, px: the rotated pattern of a descriptor
/// reaches 18 px.
constexpr int kEdge_px = 19;
/// Radius of the circle of FAST, px.
constexpr int kCircle_px = 3;
/// Keypoints per cell of the grid that spreads them. With fewer, weak keypoints replace strong
/// ones.
constexpr int kPerCell = 5;

void validate(int width, int height, const FeatureRule& rule) {
  constexpr int kMaxSize = 65536;
  require(width >= 1 && width <= kMaxSize, kFunction, "width must be in 1..65536", width);
  require(height >= 1 && height <= kMaxSize, kFunction, "height must be in 1..65536", height);
  require(rule.count > 0, kFunction, "rule.count must be positive", rule.count);
  require(rule.scale_step > 1 && std::isfinite(rule.scale_step), kFunction,
          "rule.scale_step must be above 1 and finite", rule.scale_step);
  require(rule.levels >= 1 && rule.levels <= 16, kFunction, "rule.levels must be in 1..16",
          rule.levels);
  require(rule.fast_threshold >= 1 && rule.fast_threshold <= 254, kFunction,
          "rule.fast_threshold must be in 1..254", rule.fast_threshold);
}

/// Share of the keypoints of this level among those of this and all coarser levels: the number of
/// keypoints of a level is proportional to its number of rows.
double share_of(int levels_left, double scale_step) {
  const double next = 1 / scale_step;
  return (1 - next) / (1 - std::pow(next, levels_left));
}

KeyPoints keypoints_of(const cv::Mat& level, int threshold) {
  constexpr int kMargin_px = kEdge_px - kCircle_px;
  const cv::Rect inner(kMargin_px, kMargin_px, level.cols - 2 * kMargin_px,
                       level.rows - 2 * kMargin_px);
  KeyPoints keypoints;
  cv::FAST(level(inner), keypoints, threshold);
  for (cv::KeyPoint& keypoint : keypoints) keypoint.pt += cv::Point2f(kMargin_px, kMargin_px);
  return keypoints;
}

/// Selects `count` keypoints: the strongest of each cell of a grid, then the second of each, etc.
KeyPoints select_spread(KeyPoints keypoints, cv::Size size, int count) {
  if (keypoints.size() <= std::size_t(count)) return keypoints;
  const auto weaker = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.response > b.response;
  };
  std::stable_sort(keypoints.begin(), keypoints.end(), weaker);
  const double side = std::sqrt(double(size.width) * size.height * kPerCell / std::max(count, 1));
  const int columns = int(std::ceil(size.width / side)), rows = int(std::ceil(size.height / side));
  std::vector<int> rank_of_cell(std::size_t(columns) * std::size_t(rows), 0);
  for (cv::KeyPoint& keypoint : keypoints) {
    const int column = int(keypoint.pt.x) * columns / size.width;
    const int row = int(keypoint.pt.y) * rows / size.height;
    keypoint.class_id = rank_of_cell[std::size_t(row * columns + column)]++;
  }
  const auto later = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.class_id < b.class_id;
  };
  std::stable_sort(keypoints.begin(), keypoints.end(), later);
  keypoints.resize(std::size_t(count));
  return keypoints;
}

/// Half widths of the rows of a disc of radius kPatch_px, from its central row on, px.
std::array<int, kPatch_px + 1> disc_rows() {
  std::array<int, kPatch_px + 1> half{};
  for (int v = 0; v <= kPatch_px; ++v) {
    half[std::size_t(v)] = int(std::lround(std::sqrt(double(kPatch_px * kPatch_px - v * v))));
  }
  return half;
}

/// Orientation of a keypoint: direction to the intensity centroid of its patch, degrees.
float orientation_of(const cv::Mat& level, const cv::KeyPoint& keypoint) {
  static const std::array<int, kPatch_px + 1> kHalf = disc_rows();
  int sum_u = 0, sum_v = 0;
  for (int v = -kPatch_px; v <= kPatch_px; ++v) {
    const std::uint8_t* row = level.ptr<std::uint8_t>(int(keypoint.pt.y) + v) + int(keypoint.pt.x);
    const int half = kHalf[std::size_t(std::abs(v))];
    int sum = 0;
    for (int u = -half; u <= half; ++u) {
      sum += row[u];
      sum_u += u * row[u];
    }
    sum_v += v * sum;
  }
  return cv::fastAtan2(float(sum_v), float(sum_u));
}

/// Position in the image of the centre of a pixel of a level: levels are scaled about the corner of
/// the image, not about the centre of its first pixel.
cv::Point2f pixel_of(const cv::KeyPoint& keypoint, cv::Size level, int width, int height) {
  return {(keypoint.pt.x + 0.5f) * float(width) / float(level.width),
          (keypoint.pt.y + 0.5f) * float(height) / float(level.height)};
}

void append(Features& features, const KeyPoints& keypoints, const cv::Mat& descriptors,
            cv::Size level, int width, int height) {
  for (const cv::KeyPoint& keypoint : keypoints) {
    const cv::Point2f pixel = pixel_of(keypoint, level, width, height);
    features.pixels.insert(features.pixels.end(), {pixel.x, pixel.y});
  }
  features.descriptors.insert(features.descriptors.end(), descriptors.datastart,
                              descriptors.dataend);
}

}  // namespace

Features features_of(const std::uint8_t* grey, int width, int height, const std::uint8_t* mask,
                     const FeatureRule& rule) {
  validate(width, height, rule);
  const cv::Ptr<cv::ORB> orb =
      cv::ORB::create(rule.count, float(rule.scale_step), 1, kEdge_px, 0, 2, cv::ORB::FAST_SCORE,
                      2 * kPatch_px + 1, rule.fast_threshold);
  // OpenCV takes a non-const pointer, but only reads.
  cv::Mat level(height, width, CV_8U, const_cast<std::uint8_t*>(grey));
  Features features;
  for (int k = 0; k < rule.levels; ++k) {
    const double scale = std::pow(rule.scale_step, k);
    const cv::Size size(cvRound(width / scale), cvRound(height / scale));
    if (std::min(size.width, size.height) <= 2 * kEdge_px) break;
    if (k > 0) {
      cv::Mat smaller;
      cv::resize(level, smaller, size, 0, 0, cv::INTER_LINEAR_EXACT);
      level = smaller;
    }
    KeyPoints keypoints = keypoints_of(level, rule.fast_threshold);
    const auto unwanted = [&](const cv::KeyPoint& keypoint) {
      const cv::Point2f pixel = pixel_of(keypoint, size, width, height);
      return mask[std::size_t(pixel.y) * std::size_t(width) + std::size_t(pixel.x)] == 0;
    };
    if (mask) {
      keypoints.erase(std::remove_if(keypoints.begin(), keypoints.end(), unwanted),
                      keypoints.end());
    }
    // Keypoints that finer levels lack are taken from coarser ones.
    const int left = rule.count - int(features.size());
    keypoints = select_spread(std::move(keypoints), size,
                              cvRound(left * share_of(rule.levels - k, rule.scale_step)));
    if (keypoints.empty()) continue;
    for (cv::KeyPoint& keypoint : keypoints) keypoint.angle = orientation_of(level, keypoint);
    cv::Mat descriptors;
    orb->compute(level, keypoints, descriptors);
    append(features, keypoints, descriptors, size, width, height);
  }
  return features;
}

}  // namespace gslts::reloc
