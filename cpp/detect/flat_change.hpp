#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "gslts/detect/objects.hpp"

namespace gslts::detect {

/// [H,W] float: by how much a colour of one image, summed over the channels, is beyond all that the
/// other shows within `reach_px`, so that edges a little off do not count; 0 where nothing is
/// known.
struct Foreign {
  cv::Mat in_photo, in_map;
};

Foreign foreign_colors(const Views& views, const Masks& masks, int reach_px);

/// Whether foreign colours end at the outline of a region, as a thing does and light does not.
/// @param most  [H,W] the larger of the two of `Foreign`.
/// @param region  [H,W] 1 inside.
bool has_outline(const cv::Mat& most, const cv::Mat& region);

/// In which of the two images a thing lies that is too flat for the depth of single pixels: by the
/// mean depth inside against that around it, else by where its colours or its outline stand out.
/// @param region  [H,W] 1 inside.
/// @return Nothing if none of them tells.
std::optional<Side> side_of_flat(const Views& views, const Foreign& foreign, const cv::Mat& region,
                                 const ObjectRule& rule);

}  // namespace gslts::detect
