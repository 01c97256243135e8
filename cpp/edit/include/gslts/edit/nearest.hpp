#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// For Q points, the k nearest of N others, the nearest first.
struct Neighbours {
  int k = 0;
  Array<std::uint32_t> rows;  ///< [Q,k]
  Array<float> distances_m;   ///< [Q,k]
};

/// Finds the Gaussians whose centres are nearest to points, exactly, with a k-d tree of FLANN.
///
/// @param points  [count,3] in the frame of the centres: relative to the map's origin, m.
/// @param k  At least 1; fewer neighbours are found where there are fewer Gaussians.
/// @throws std::invalid_argument  if k is below 1, there is no Gaussian, or a point or a centre is
///   not finite.
Neighbours nearest_gaussians(const GaussianView<float>& gaussians, const float* points,
                             std::size_t count, int k);

}  // namespace gslts::edit
