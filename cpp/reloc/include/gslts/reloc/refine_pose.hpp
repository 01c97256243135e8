#pragma once

#include <vector>

#include "gslts/align/view_cost.hpp"

namespace gslts::reloc {

/// Settings of the refinement of a pose.
struct RefineRule {
  align::CostRule cost;
  int iterations = 8;        ///< Maximum number at each resolution. >= 0
  double min_step_m = 1e-4;  ///< Length of a step, m and rad, below which it is the last one at
                             ///< full size; twice as much at half the size, and so on. >= 0
};

/// The pose at which an image fits a map best.
struct RefinedPose {
  Eigen::Isometry3d world_from_camera;
  /// Curvature of the cost at the pose, by a twist (rho, phi) of world_from_camera * exp(rho, phi),
  /// m before rad: the information of the image about each direction.
  Matrix6 curvature = Matrix6::Zero();
  double cost = 0;         ///< Mean over the known pixels, at the finest resolution.
  align::Fit fit;          ///< There, too; known pixels are those where its resolution began.
  int iterations = 0;      ///< Sum over all resolutions.
  bool converged = false;  ///< True if the last resolution converged within its iterations.
};

/// Refines a pose by inverting the rendering (iComMa, Sun et al. 2023), with Levenberg-Marquardt on
/// SE(3) (Ceres): it descends along the rasterizer's exact gradient with the curvature of direct
/// image alignment, in a few steps where the gradient alone takes hundreds. Each resolution starts
/// from the result of the one before; the second one from the start, if that fits better.
/// @param maps  To compare the images with: one map for all, or one per image.
/// @param views  One image in several resolutions, the coarsest first.
/// @param start  world_from_camera, up to some pixels of the coarsest image off.
/// @return  The start, not converged, if the map is not seen from there.
/// @throws std::invalid_argument  if there is no view, a number of maps other than one or that of
///   the views, or a view, the pose or a setting is invalid.
RefinedPose refine_pose(const std::vector<GaussianView<float>>& maps,
                        const std::vector<align::RgbdView<float>>& views,
                        const Eigen::Isometry3d& start, const RefineRule& rule = {});

}  // namespace gslts::reloc
