#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "gslts/map/camera.hpp"

namespace gslts::reloc {

/// A feature, and where in the world it may be.
struct Match {
  Eigen::Vector2d pixel;
  double depth_m;  ///< z of the feature; 0 where it is not measured.
  Eigen::Vector3d x_in_world;
};
using MatchSet = std::vector<Match>;

/// What an inlier is, and how long to look for a pose that has them.
struct RansacRule {
  double inlier_px;
  double inlier_depth;  ///< Relative.
  int least_inliers;
  int iterations;
};

/// How well a pose explains a match: 1 exactly, down to 0 where it is no inlier.
double support_of(const Camera& camera, const Eigen::Isometry3d& camera_from_world,
                  const Match& match, const RansacRule& rule);

/// The pose that most matches support (camera_from_world), refined over them; none with too few.
/// The same matches always give the same pose.
std::optional<Eigen::Isometry3d> ransac(const Camera& camera, const MatchSet& matches,
                                        const RansacRule& rule);

/// The pose of least squared errors of the matches that it explains, which are chosen anew after
/// each step; the given one where they do not determine it.
Eigen::Isometry3d refined(const Camera& camera, Eigen::Isometry3d camera_from_world,
                          const MatchSet& matches, const RansacRule& rule);

}  // namespace gslts::reloc
