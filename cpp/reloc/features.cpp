#include "gslts/reloc/features.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace gslts::reloc {
namespace {

using KeyPoints = std::vector<cv::KeyPoint>;

/// Radius of the patch whose centroid tells the direction of a corner, as in the paper, px.
constexpr int kPatch_px = 15;
/// Corners keep so far away from the edge: the turned pattern of a descriptor reaches 18 px.
constexpr int kEdge_px = 19;
/// Radius of the circle of FAST, px.
constexpr int kCircle_px = 3;
/// Corners wanted of a cell: with fewer, corners that are hardly any take the place of good ones.
constexpr int kPerCell = 5;

template <typename Value>
void require(bool fits, const char* what, Value value) {
  if (fits) return;
  std::ostringstream message;
  message << "features_of: " << what << ", got " << value;
  throw std::invalid_argument(message.str());
}

void validate(int width, int height, const FeatureRule& rule) {
  constexpr int kMaxSize = 65536;
  require(width >= 1 && width <= kMaxSize, "width must be in 1..65536", width);
  require(height >= 1 && height <= kMaxSize, "height must be in 1..65536", height);
  require(rule.count > 0, "rule.count must be positive", rule.count);
  require(rule.scale_step > 1 && std::isfinite(rule.scale_step),
          "rule.scale_step must be above 1 and finite", rule.scale_step);
  require(rule.levels >= 1 && rule.levels <= 16, "rule.levels must be in 1..16", rule.levels);
  require(rule.fast_threshold >= 1 && rule.fast_threshold <= 254,
          "rule.fast_threshold must be in 1..254", rule.fast_threshold);
}

/// Share of this level and the coarser ones that falls to this one, as each level has so many times
/// fewer features than the one before as it has fewer rows.
double share_of(int levels_left, double scale_step) {
  const double next = 1 / scale_step;
  return (1 - next) / (1 - std::pow(next, levels_left));
}

KeyPoints corners_of(const cv::Mat& level, int threshold) {
  constexpr int kMargin_px = kEdge_px - kCircle_px;
  const cv::Rect inner(kMargin_px, kMargin_px, level.cols - 2 * kMargin_px,
                       level.rows - 2 * kMargin_px);
  KeyPoints corners;
  cv::FAST(level(inner), corners, threshold);
  for (cv::KeyPoint& corner : corners) corner.pt += cv::Point2f(kMargin_px, kMargin_px);
  return corners;
}

/// So many corners: the strongest of each cell of a grid, then the second of each, and so on.
KeyPoints spread(KeyPoints corners, cv::Size size, int count) {
  if (corners.size() <= std::size_t(count)) return corners;
  const auto weaker = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.response > b.response;
  };
  std::stable_sort(corners.begin(), corners.end(), weaker);
  const double side = std::sqrt(double(size.width) * size.height * kPerCell / std::max(count, 1));
  const int columns = int(std::ceil(size.width / side)), rows = int(std::ceil(size.height / side));
  std::vector<int> met(std::size_t(columns) * std::size_t(rows), 0);
  for (cv::KeyPoint& corner : corners) {
    const int column = int(corner.pt.x) * columns / size.width;
    const int row = int(corner.pt.y) * rows / size.height;
    corner.class_id = met[std::size_t(row * columns + column)]++;
  }
  const auto later = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.class_id < b.class_id;
  };
  std::stable_sort(corners.begin(), corners.end(), later);
  corners.resize(std::size_t(count));
  return corners;
}

/// Half the width of each row of a disc, from its middle on.
std::array<int, kPatch_px + 1> disc_rows() {
  std::array<int, kPatch_px + 1> half{};
  for (int v = 0; v <= kPatch_px; ++v) {
    half[std::size_t(v)] = int(std::lround(std::sqrt(double(kPatch_px * kPatch_px - v * v))));
  }
  return half;
}

/// Direction from a corner to the centroid of the grey around it, degrees.
float direction_of(const cv::Mat& level, const cv::KeyPoint& corner) {
  static const std::array<int, kPatch_px + 1> kHalf = disc_rows();
  int sum_u = 0, sum_v = 0;
  for (int v = -kPatch_px; v <= kPatch_px; ++v) {
    const std::uint8_t* row = level.ptr<std::uint8_t>(int(corner.pt.y) + v) + int(corner.pt.x);
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

/// Where the centre of a pixel of a level is in the picture: levels are scaled about the corner of
/// the picture, not about the centre of its first pixel.
cv::Point2f pixel_of(const cv::KeyPoint& corner, cv::Size level, int width, int height) {
  return {(corner.pt.x + 0.5f) * float(width) / float(level.width),
          (corner.pt.y + 0.5f) * float(height) / float(level.height)};
}

void append(Features& features, const KeyPoints& corners, const cv::Mat& descriptors,
            cv::Size level, int width, int height) {
  for (const cv::KeyPoint& corner : corners) {
    const cv::Point2f pixel = pixel_of(corner, level, width, height);
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
  // OpenCV takes pointers to what it only reads.
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
    KeyPoints corners = corners_of(level, rule.fast_threshold);
    const auto unwanted = [&](const cv::KeyPoint& corner) {
      const cv::Point2f pixel = pixel_of(corner, size, width, height);
      return mask[std::size_t(pixel.y) * std::size_t(width) + std::size_t(pixel.x)] == 0;
    };
    if (mask) {
      corners.erase(std::remove_if(corners.begin(), corners.end(), unwanted), corners.end());
    }
    // What finer levels lack, coarser ones may have.
    const int left = rule.count - int(features.size());
    corners = spread(std::move(corners), size,
                     cvRound(left * share_of(rule.levels - k, rule.scale_step)));
    if (corners.empty()) continue;
    for (cv::KeyPoint& corner : corners) corner.angle = direction_of(level, corner);
    cv::Mat descriptors;
    orb->compute(level, corners, descriptors);
    append(features, corners, descriptors, size, width, height);
  }
  return features;
}

}  // namespace gslts::reloc
