#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::fusion {

/// A point that a depth image measured on a surface.
struct SurfacePoint {
  Eigen::Vector3d position;  ///< In the world, m.
  Eigen::Vector3d normal;    ///< In the world, of length 1, towards the camera.
  Eigen::Vector3d color;     ///< sRGB, 0 to 1.
  double squared_detail;     ///< Squared gradient of the brightness along the surface, 1/m^2.
};

/// Computes the points of every n-th row and column; see `SurfaceVoxels::add`.
/// @param camera  Valid.
/// @param pixel_step  n
/// @throws std::invalid_argument  if a depth is negative or infinite.
Array<SurfacePoint> surface_points(const float* depth, const std::uint8_t* rgb,
                                   const Camera& camera, const std::uint8_t* mask, int pixel_step);

}  // namespace gslts::fusion
