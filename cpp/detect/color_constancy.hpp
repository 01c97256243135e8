#pragma once

#include <opencv2/core.hpp>

namespace gslts::detect {

/// Gives a rendering the light of a frame: white balance, vignetting and light that moved.
///
/// A gain for each channel, smooth over the image, is fitted to the pixels on which both agree.
/// @param rendered  [H,W] of three floats, sRGB.
/// @param observed  The same of the frame.
/// @param known  [H,W] bytes, not 0 where both images are valid.
/// @return  The rendering times the gain.
cv::Mat match_light(const cv::Mat& rendered, const cv::Mat& observed, const cv::Mat& known);

}  // namespace gslts::detect
