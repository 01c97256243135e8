#pragma once

#include "gslts/detect/masks.hpp"
#include "gslts/detect/surface.hpp"
#include "images.hpp"

namespace gslts::detect {

/// Returns the box around a region and the ring around it, in the image.
cv::Rect with_ring(const cv::Rect& box, const Camera& camera);

/// Returns the diameter of the largest disc in a region, px.
double thickness_px(const cv::Mat& region);

/// Measures the evidence of a surface from its pixels (at least one) and those around them; all but
/// `step_ratio` and `changed_share`, which are left to the caller.
Evidence evidence_of(const Views& views, const Masks& masks, const Pixels& pixels,
                     const Surface& surface);

}  // namespace gslts::detect
