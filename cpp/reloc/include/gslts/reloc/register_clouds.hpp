#pragma once

#include <Eigen/Geometry>
#include <cstddef>

namespace gslts::reloc {

/// Settings of the registration of two clouds.
struct CloudRule {
  double voxel_m = 0.05;         ///< Edge of the voxels that both are downsampled to, m. 1e-4 to 10
  double max_distance_m = 0.15;  ///< Maximum distance of corresponding points, m. (0, 100]
  int neighbours = 12;           ///< Points that determine the plane at a point. >= 4
  int iterations = 20;           ///< Maximum number. > 0
};

/// A rigid motion that registers one cloud with another.
struct Registration {
  Eigen::Isometry3d target_from_source;
  double overlap;  ///< Share of the downsampled source points with a correspondence, 0 to 1.
  double rms_m;    ///< RMS distance of these from the planes of the target; 0 if there are none.
  bool converged;  ///< True if the motion converged within the iterations. False also if a
                   ///< downsampled cloud has fewer points than `neighbours`: then the guess is
                   ///< returned, with no overlap.
};

/// Registers two clouds by generalised ICP (Segal et al. 2009; PCL), plane to plane. Where the
/// clouds do not constrain the motion, such as along a wall or a corridor, it stays near the guess.
/// @param source  [sources,3] m.
/// @param target  [targets,3] m; only points near the source are used.
/// @param guess  target_from_source, up to about `max_distance_m` off.
/// @throws std::invalid_argument  if a point is not finite, the guess is not a rigid motion, a
///   setting is out of range, or a cloud spans more than 2^31 voxels.
Registration register_clouds(const float* source, std::size_t sources, const float* target,
                             std::size_t targets, const Eigen::Isometry3d& guess,
                             const CloudRule& rule = {});

}  // namespace gslts::reloc
