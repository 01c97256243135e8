#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/reloc/landmark_index.hpp"

namespace gslts::reloc {

/// How poses are guessed from features.
struct HypothesisRule {
  int neighbours = 4;        ///< Landmarks that a feature may be, 1 to 16.
  int most_bits = 64;        ///< Hamming distance of what may be the same corner, 0 to 256.
  double ratio = 0.85;       ///< Of the distances to the nearest landmark and to the next one that
                             ///< is elsewhere (Lowe 2004), for matches among all landmarks. (0, 1]
  double elsewhere_m = 0.1;  ///< Landmarks that are nearer to each other are one corner, m. >= 0
  int keyframes = 8;         ///< With the most votes, that are tried one by one. >= 0
  double inlier_px = 4.0;    ///< Error of the reprojection of an inlier, px. > 0
  double inlier_depth = 0.05;  ///< Relative error of its depth, where it is measured. > 0
  int least_inliers = 10;      ///< Of a pose worth looking at. >= 4
  int iterations = 500;        ///< Poses that each RANSAC tries at most. > 0
};

/// A pose that some features support.
struct Hypothesis {
  Eigen::Isometry3d world_from_camera;
  int inliers;   ///< Corners that it explains; one found at several levels counts once.
  int keyframe;  ///< Of the map that it was found with; -1 if with all of them.
};

/// Poses that a picture may have been taken from: matches are sorted out by the ratio of their
/// distances and over all landmarks, and by keyframes that many features vote for, each on its own,
/// so that places which look alike come out as several poses. From each set of matches a pose is
/// found by RANSAC, from three points where depth is measured (Umeyama 1991) and by P3P (Gao et al.
/// 2003) elsewhere, and refined over all features that it explains. The same input always gives the
/// same poses.
/// @param camera  Its intrinsics; its pose is not used.
/// @param depths  [M] z of the features, m; 0 or NaN where there is none.
/// @return  Those with most inliers first; poses that are nearly the same only once.
/// @throws std::invalid_argument  if the camera, a pixel or a setting is invalid.
std::vector<Hypothesis> hypotheses_of(const Camera& camera, const Features& features,
                                      const float* depths, const LandmarkIndex& index,
                                      const HypothesisRule& rule = {});

}  // namespace gslts::reloc
