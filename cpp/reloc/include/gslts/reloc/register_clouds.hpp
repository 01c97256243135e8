#pragma once

#include <Eigen/Geometry>
#include <cstddef>

namespace gslts::reloc {

/// How clouds are brought together.
struct CloudRule {
  double voxel_m = 0.05;         ///< Both clouds are thinned to one point in each, m. 1e-4 to 10
  double most_distant_m = 0.15;  ///< Points that are farther apart are not paired, m. (0, 100]
  int neighbours = 12;           ///< Of a point, that tell its plane. >= 4
  int iterations = 20;           ///< At most. > 0
};

/// A motion that brings one cloud onto another.
struct Registration {
  Eigen::Isometry3d target_from_source;
  double overlap;  ///< Share of the thinned source points that have a partner, 0 to 1.
  double rms_m;    ///< Of their distances from the planes of their partners; 0 if there are none.
  bool converged;  ///< The motion came to rest before the iterations ran out. False also where a
                   ///< thinned cloud has fewer points than `neighbours`: then the guess comes
                   ///< back, with no overlap.
};

/// Generalised ICP (Segal et al. 2009; PCL): surface against surface. Along a single plane or a
/// corridor nothing holds the clouds; there the motion stays near the guess.
/// @param source, target  [N,3], [M,3], m; of the target only what is around the source counts.
/// @param guess  target_from_source, some `most_distant_m` off at most.
/// @throws std::invalid_argument  if a point is not finite, the guess is not a rigid motion, a
///   setting is out of range, or a cloud is so large that its voxels cannot be numbered (2^31).
Registration register_clouds(const float* source, std::size_t sources, const float* target,
                             std::size_t targets, const Eigen::Isometry3d& guess,
                             const CloudRule& rule = {});

}  // namespace gslts::reloc
