#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "surface.hpp"

namespace gslts::detect {

/// In which of the two images a thing lies that is too flat for the depth of single pixels: by the
/// mean depth inside against that around it, else by where its outline stands out.
/// @param region  [H,W] 1 inside.
/// @return Nothing if neither tells.
std::optional<Side> side_of_flat(const Views& views, const cv::Mat& region, const ObjectRule& rule);

}  // namespace gslts::detect
