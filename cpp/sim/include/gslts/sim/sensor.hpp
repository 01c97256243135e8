#pragma once

#include <array>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::sim {

/// Model of a colour camera.
struct ColorSensor {
  std::array<double, 3> gains;  ///< Factors of red, green and blue.
  double vignetting;            ///< Share of the light that is lost in the corners of the image.
  double noise_std;             ///< Standard deviation of the noise of a channel, 0 to 1.
};

/// Model of a depth camera: noise and missing measurements.
struct DepthSensor {
  double std_m;          ///< Standard deviation of the noise at depth 0, m.
  double std_per_m;      ///< Its growth with the squared depth, m/m^2.
  double near_m, far_m;  ///< Range of depths that are measured, m.
  double least_cosine;   ///< Minimum cosine between ray and normal of a measured surface.
  double edge_dropout;   ///< Probability of no measurement at an edge of the depth.
  double dropout;        ///< Probability of no measurement elsewhere.
};

/// Makes an sRGB image (IEC 61966-2-1) of linear light.
///
/// @param radiance  [H,W,3] linear RGB.
/// @param normals  [H,W,3] standard normal numbers, the noise; null: there is none.
/// @param threads  0 means one per hardware thread; the result does not depend on it.
/// @return  [H,W,3]
/// @throws std::invalid_argument  if threads is negative.
Array<std::uint8_t> measure_color(const double* radiance, const double* normals, int width,
                                  int height, const ColorSensor& sensor, int threads);

/// Makes a depth image with noise and holes.
///
/// @param depth  [H,W] true depth, m; 0 where nothing is.
/// @param cosines  [H,W] between surface normal and ray.
/// @param normals  [H,W] standard normal numbers.
/// @param uniforms  [H,W] numbers in 0 to 1, which decide the dropout.
/// @param threads  0 means one per hardware thread; the result does not depend on it.
/// @return  [H,W] m; 0 where nothing is measured.
/// @throws std::invalid_argument  if threads is negative.
Array<float> measure_depth(const float* depth, const float* cosines, const double* normals,
                           const double* uniforms, int width, int height, const DepthSensor& sensor,
                           int threads);

}  // namespace gslts::sim
