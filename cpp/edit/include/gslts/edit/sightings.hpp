#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// What a depth camera measured.
struct DepthView {
  Camera camera;
  const float* measured;  ///< [H,W] depth, z, m; 0 and NaN mean no measurement.
};

/// Depths that differ by no more are the same.
struct DepthRule {
  double margin_m = 0.03;      ///< At the camera,
  double margin_share = 0.02;  ///< and by so much of the depth more.
};

/// For N Gaussians; views that look elsewhere, or at something before the Gaussian, do not count.
struct Sightings {
  Array<std::int32_t> on;       ///< [N] views that measured a surface at the centre.
  Array<std::int32_t> through;  ///< [N] views that measured one behind it: nothing can be there.
};

/// Counts the views that saw a surface at each Gaussian's centre, or through it.
///
/// @throws std::invalid_argument  if the Gaussians, a camera or the rule are not valid, or a view
///   has no depth.
Sightings sightings_of(const GaussianView<float>& gaussians, const std::vector<DepthView>& views,
                       const DepthRule& rule);

}  // namespace gslts::edit
