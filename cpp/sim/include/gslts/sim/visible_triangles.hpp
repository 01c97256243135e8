#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::sim {

/// Finds the nearest triangle in front of a camera at each pixel centre, by rasterization.
///
/// The same triangles as those that the rays of `pixel_rays` hit first, but for rays that pass an
/// edge or two coincident surfaces within rounding. Both sides of a triangle are visible. Surfaces
/// without gaps have none in the image. Of triangles at the same distance, the first is taken.
///
/// Source: Olano and Greer 1997, Triangle Scan Conversion using 2D Homogeneous Coordinates.
///
/// @param corners  [T,3,3] m, world.
/// @param count  T
/// @param threads  0 means one per hardware thread; the result does not depend on it.
/// @return  [H,W] index; `kNoTriangle` where nothing is hit.
/// @throws std::invalid_argument  if the camera is not valid or threads is negative.
Array<std::uint32_t> visible_triangles(const Camera& camera, const float* corners,
                                       std::size_t count, int threads);

}  // namespace gslts::sim
