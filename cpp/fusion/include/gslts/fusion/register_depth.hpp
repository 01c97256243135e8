#pragma once

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::fusion {

/// Registers a depth image to another camera.
///
/// Each measured pixel is projected as a small planar patch that it and its neighbours determine,
/// so that surfaces stay closed and planes stay planes whatever the sizes of the images. Where
/// several patches overlap, the nearest one counts.
///
/// @param depth  [H,W] of `depth_camera`, z in m; 0 and NaN mean no measurement.
/// @param depth_camera, camera  With poses in one common frame; only their relative pose counts.
/// @return [H',W'] of `camera`, z in m; 0 where no patch is projected.
/// @throws std::invalid_argument  if a camera is invalid.
Array<float> register_depth(const float* depth, const Camera& depth_camera, const Camera& camera);

}  // namespace gslts::fusion
