#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "gslts/detect/objects.hpp"

namespace gslts::detect {

/// [H,W] float: by how much a colour of one image, summed over the channels, is outside the range
/// of colours that the other shows within `edge_tolerance_px`, so that misplaced edges do not
/// count; 0 where the map is not known.
struct ColorChange {
  cv::Mat observed, rendered;
  cv::Mat larger;  ///< The larger of both.
};

ColorChange compare_colors(const Views& views, const Masks& masks, int edge_tolerance_px);

/// Tests whether the colour change ends at the outline of a region, as an object does and light
/// does not.
/// @param color_change  [H,W] `ColorChange::larger`.
/// @param region  [H,W] not 0 inside.
bool has_outline(const cv::Mat& color_change, const cv::Mat& region);

/// Decides in which of the two images an object lies that is too flat for the depth of single
/// pixels: by the median depth inside against that around it, else by the image in which its
/// colours or its outline stand out.
/// @param region  [H,W] not 0 inside.
/// @return  Nothing if none of them decides.
std::optional<Side> side_of_flat(const Views& views, const ColorChange& colors,
                                 const cv::Mat& region, const ObjectRule& rule);

}  // namespace gslts::detect
