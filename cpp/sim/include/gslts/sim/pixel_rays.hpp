#pragma once

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::sim {

/// Makes the rays from the eye of a camera through the centres of its pixels.
///
/// @param threads  0 means one per hardware thread.
/// @return  [H,W,6] origin, m, and direction in world axes, whose z in the camera frame is 1: a
///   distance along it is a depth.
/// @throws std::invalid_argument  if the camera is not valid or threads is negative.
Array<float> pixel_rays(const Camera& camera, int threads);

}  // namespace gslts::sim
