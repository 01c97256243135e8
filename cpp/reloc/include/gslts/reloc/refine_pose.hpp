#pragma once

#include <vector>

#include "gslts/align/view_cost.hpp"

namespace gslts::reloc {

/// How a pose is refined.
struct RefineRule {
  align::CostRule cost;
  int iterations = 8;          ///< At each resolution, at most. >= 0
  double least_step_m = 1e-4;  ///< A step that is shorter, and turns less than so many rad, is the
                               ///< last one; twice as much at half the resolution, and so on. >= 0
};

/// A pose where a picture fits a map best.
struct RefinedPose {
  Eigen::Isometry3d world_from_camera;
  /// Curvature of the cost there, by a twist (rho, phi) of world_from_camera * exp(rho, phi): what
  /// the picture tells about each direction, m before rad.
  align::Matrix6 curvature = align::Matrix6::Zero();
  double cost = 0;         ///< Mean over the pixels that count, at the finest resolution.
  align::Fit fit;          ///< There, too; with what counts as known where its resolution began.
  int iterations = 0;      ///< Of all resolutions.
  bool converged = false;  ///< Whether the last resolution ended before its iterations did.
};

/// Inverts the rendering for its camera (iComMa, Sun et al. 2023), by Levenberg and Marquardt's
/// method on SE(3) (Ceres): descends along the rasterizer's exact gradient with the curvature of
/// direct image alignment, which takes a few steps where the gradient alone takes hundreds. Each
/// resolution goes on from what the one before came to, the second one from the start if that fits
/// better.
/// @param maps  With which each picture is compared: one for all, or one for each.
/// @param views  One picture in several resolutions, the coarsest first.
/// @param start  world_from_camera, some pixels of the coarsest picture off at most.
/// @return  The start, not converged, if the map is not seen from there.
/// @throws std::invalid_argument  if there is no view, not one map a view, or a view, the pose or a
///                                setting is invalid.
RefinedPose refine_pose(const std::vector<GaussianView<float>>& maps,
                        const std::vector<align::RgbdView<float>>& views,
                        const Eigen::Isometry3d& start, const RefineRule& rule = {});

}  // namespace gslts::reloc
