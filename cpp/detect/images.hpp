#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "constants.hpp"
#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"
#include "order_statistics.hpp"

namespace gslts::detect {

/// Indices of pixels, row by row.
using Pixels = std::vector<std::size_t>;

/// Wraps an image without copying it; const memory must not be written to.
inline cv::Mat image_of(const float* pixels, const Camera& camera, int channels = 1) {
  return {camera.height, camera.width, CV_MAKETYPE(CV_32F, channels), const_cast<float*>(pixels)};
}

/// Wraps a mask without copying it; const memory must not be written to.
inline cv::Mat image_of(const Array<std::uint8_t>& mask, const Camera& camera) {
  return {camera.height, camera.width, CV_8U, const_cast<std::uint8_t*>(mask.data())};
}

/// Copies a continuous image of bytes.
inline Array<std::uint8_t> array_of(const cv::Mat& mask) {
  Array<std::uint8_t> array(mask.total());
  std::copy_n(mask.ptr<std::uint8_t>(), mask.total(), array.begin());
  return array;
}

/// Returns a mask [H,W] that is 255 at some pixels.
inline cv::Mat mask_of(const Pixels& pixels, const Camera& camera) {
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8U);
  for (const std::size_t k : pixels) mask.ptr<std::uint8_t>()[k] = 255;
  return mask;
}

/// Returns the box around some pixels, at least one.
inline cv::Rect box_of(const Pixels& pixels, const Camera& camera) {
  int left = camera.width, top = camera.height, right = 0, bottom = 0;
  for (const std::size_t k : pixels) {
    const int x = int(k % std::size_t(camera.width)), y = int(k / std::size_t(camera.width));
    left = std::min(left, x), right = std::max(right, x + 1);
    top = std::min(top, y), bottom = std::max(bottom, y + 1);
  }
  return {cv::Point(left, top), cv::Point(right, bottom)};
}

/// Structuring elements of a radius in px.
inline cv::Mat square(int radius_px) {
  const int side = 2 * radius_px + 1;
  return cv::Mat::ones(side, side, CV_8U);
}
inline cv::Mat disc(int radius_px) {
  const int side = 2 * radius_px + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
}

/// Grows a mask by a radius in px.
inline cv::Mat grow(const cv::Mat& region, int radius_px) {
  cv::Mat larger;
  cv::dilate(region, larger, disc(radius_px));
  return larger;
}

/// Returns the pixels that are more than `start_px` and at most `end_px` outside a region.
inline cv::Mat ring(const cv::Mat& region, int start_px, int end_px) {
  return grow(region, end_px) - grow(region, start_px);
}

/// Computes the magnitude of the gradient of an image of one channel, per px (Sobel).
inline cv::Mat gradient_magnitude(const cv::Mat& image) {
  cv::Mat along_x, along_y, magnitude;
  cv::Sobel(image, along_x, CV_32F, 1, 0, 3, kSobelScale);
  cv::Sobel(image, along_y, CV_32F, 0, 1, 3, kSobelScale);
  cv::magnitude(along_x, along_y, magnitude);
  return magnitude;
}

inline cv::Mat gray_of(const cv::Mat& rgb) {
  cv::Mat gray;
  cv::cvtColor(rgb, gray, cv::COLOR_RGB2GRAY);
  return gray;
}

/// Returns the absolute difference of two colours, summed over the channels.
inline float color_difference(const float* a, const float* b) {
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

/// Tests whether a depth is measured or rendered.
inline bool has_depth(float depth_m) { return depth_m > 0 && std::isfinite(depth_m); }

/// Lists the differences of two images of depths where both have one and `where` is not 0, m.
inline std::vector<float> depth_differences(const cv::Mat& depth, const cv::Mat& other,
                                            const cv::Mat& where) {
  std::vector<float> differences;
  for (int y = 0; y < where.rows; ++y) {
    for (int x = 0; x < where.cols; ++x) {
      const float here = depth.at<float>(y, x), there = other.at<float>(y, x);
      if (where.at<std::uint8_t>(y, x) && has_depth(here) && has_depth(there)) {
        differences.push_back(here - there);
      }
    }
  }
  return differences;
}

/// Returns the median of `depth_differences`, m; 0 if there are hardly any.
inline double median_difference_m(const cv::Mat& depth, const cv::Mat& other,
                                  const cv::Mat& where) {
  const std::vector<float> differences = depth_differences(depth, other, where);
  return differences.size() < kMinDepthPixels ? 0 : double(median(differences));
}

/// Returns a point in the world from its image coordinates, px, and depth, m.
inline Eigen::Vector3d unproject(const Camera& camera, double u, double v, double depth_m) {
  return camera.world_from_camera * Eigen::Vector3d((u - camera.cx) / camera.fx * depth_m,
                                                    (v - camera.cy) / camera.fy * depth_m, depth_m);
}

}  // namespace gslts::detect
