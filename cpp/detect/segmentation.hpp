#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "images.hpp"

namespace gslts::detect {

/// Divides an image into segments of similar values, by its minimum spanning forest (Felzenszwalb
/// and Huttenlocher, "Efficient Graph-Based Image Segmentation", IJCV 2004).
/// @param image  [H,W] of four floats; neighbours differ by the distance of their values.
/// @param scales  Their constants k: larger ones allow larger differences within a segment.
/// @param min_px  Smaller segments are joined with a neighbour.
/// @return  For each scale, the pixels of all segments.
std::vector<std::vector<Pixels>> segment_image(const cv::Mat& image,
                                               const std::vector<float>& scales, int min_px);

}  // namespace gslts::detect
