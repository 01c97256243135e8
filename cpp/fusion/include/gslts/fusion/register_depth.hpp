#pragma once

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::fusion {

/// A depth image as another camera would have measured it.
///
/// Each measured pixel is carried over as the small patch of surface that it and its neighbours
/// show, flat within itself, so that surfaces stay closed and planes stay planes whatever the sizes
/// of the images; of several patches at a place the nearest counts.
///
/// @param depth  [H,W] of `depth_camera`, z in m; 0 and NaN mean no measurement.
/// @param depth_camera, camera  With poses in one common frame; only their relative pose counts.
/// @return [H',W'] of `camera`, z in m; 0 where nothing arrives.
/// @throws std::invalid_argument  if a camera is invalid.
Array<float> register_depth(const float* depth, const Camera& depth_camera, const Camera& camera);

}  // namespace gslts::fusion
