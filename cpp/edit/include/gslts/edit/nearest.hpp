#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// The k nearest Gaussians of each of Q points, the nearest first.
struct Neighbours {
  int k = 0;
  Array<std::uint32_t> rows;  ///< [Q,k]
  Array<float> distances_m;   ///< [Q,k]
};

/// Finds the Gaussians whose centres are nearest to points, exactly, with a k-d tree of FLANN.
/// @param points  [count,3] relative to the map's origin, m.
/// @param k  At least 1; fewer neighbours are found where there are fewer Gaussians.
/// @throws std::invalid_argument  if k is below 1, there is no Gaussian, or a point or a centre is
///   not finite.
///
/// Source: GS-LTS, sec. III-D2, g_nn = argmin_m |mu_m - p_j|.
Neighbours nearest_gaussians(const GaussianView<float>& gaussians, const float* points,
                             std::size_t count, int k);

}  // namespace gslts::edit
