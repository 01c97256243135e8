#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"

namespace gslts::detect {

/// OpenCV's view of memory that it does not own; const memory must not be written to.
inline cv::Mat image_of(const float* pixels, const Camera& camera, int channels = 1) {
  return {camera.height, camera.width, CV_MAKETYPE(CV_32F, channels), const_cast<float*>(pixels)};
}

inline cv::Mat mask_of(const Array<std::uint8_t>& mask, const Camera& camera) {
  return {camera.height, camera.width, CV_8U, const_cast<std::uint8_t*>(mask.data())};
}

/// A copy of a continuous image of bytes.
inline Array<std::uint8_t> array_of(const cv::Mat& mask) {
  Array<std::uint8_t> array(mask.total());
  std::copy_n(mask.ptr<std::uint8_t>(), mask.total(), array.begin());
  return array;
}

/// A mask with all that is within a radius of it.
inline cv::Mat grown(const cv::Mat& region, int radius_px) {
  const int side = 2 * radius_px + 1;
  cv::Mat larger;
  cv::dilate(region, larger, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
  return larger;
}

}  // namespace gslts::detect
