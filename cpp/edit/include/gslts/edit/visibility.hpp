#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// A depth image and its camera.
struct DepthView {
  Camera camera;
  const float* observed_depth;  ///< [H,W] z in the camera frame, m; 0 and NaN: not measured.
};

/// Maximum difference of two depths of one surface: margin_m + margin_share depth.
struct DepthTolerance {
  double margin_m = 0.03;      ///< m
  double margin_share = 0.02;  ///< Share of the depth.
};

/// Visibility counts of N Gaussians. Views in which a centre is outside the image, hidden, or at a
/// pixel without depth do not count.
struct VisibilityCounts {
  Array<std::int32_t> on_surface;    ///< [N] views that measured a surface at the centre.
  Array<std::int32_t> seen_through;  ///< [N] views that measured one behind it: it is free space.
};

/// Counts the views that measured a surface at each Gaussian's centre, and those that saw through
/// it (space carving).
/// @throws std::invalid_argument  if the Gaussians, a camera or the tolerance are not valid, or a
/// view
///   has no depth.
VisibilityCounts count_visibility(const GaussianView<float>& gaussians,
                                  const std::vector<DepthView>& views,
                                  const DepthTolerance& tolerance);

}  // namespace gslts::edit
