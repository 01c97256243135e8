#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::raster::testing {

/// Result of the reference renderer.
struct OracleRender {
  Images<double> images;

  // Per pixel, how near the closest decision was to going the other way. Rounding can flip a
  // decision where the margin is small, and there alone may the kernels differ visibly.
  std::vector<double> alpha_margin;          ///< [H,W] least |alpha / alpha_min - 1|
  std::vector<double> transmittance_margin;  ///< [H,W] least |T / transmittance_min - 1|
  /// [H,W] least relative difference of the depths of two Gaussians blended one after the other;
  /// equal depths do not count, as they are ordered by row.
  std::vector<double> depth_margin;

  std::vector<double> max_weights;          ///< [N] greatest blend weight
  std::vector<std::uint32_t> pixel_counts;  ///< [N] number of pixels at which it was blended
};

/// Renders with plain loops over pixels and Gaussians, in double, written for reading.
///
/// @param mean2d_offsets_px  Added to the projected centres, [N] or empty: what derivatives with
///   respect to these are taken by.
OracleRender render_oracle(const BasicGaussianMap<double>& map, const Camera& camera,
                           const RenderOptions& options = {}, const PixelMask& mask = {},
                           const std::vector<Eigen::Vector2d>& mean2d_offsets_px = {});

}  // namespace gslts::raster::testing
