#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "gslts/detect/objects.hpp"

namespace gslts::detect {

/// [H,W] each; the masks are 255 where only one of both images has a surface.
struct DepthChange {
  Array<std::uint8_t> appeared;  ///< The frame's is nearer than all of the map's around it.
  Array<std::uint8_t> vanished;  ///< The map's is nearer than all of the frame's around it.
  Array<float> steps;  ///< Absolute difference in units of the smallest that counts; 0: unknown.
};

/// Compares the depths of frame and map.
///
/// A surface is compared with all surfaces within `edge_tolerance_px` in the other image: that
/// forgives misplaced edges, and thin objects that sensor or map do not show there.
DepthChange compare_depths(const Views& views, const Masks& masks, const ObjectRule& rule);

/// Computes the change of depth from pixel to pixel along surfaces, m; thin edges do not count.
cv::Mat surface_slope(const cv::Mat& depth);

}  // namespace gslts::detect
