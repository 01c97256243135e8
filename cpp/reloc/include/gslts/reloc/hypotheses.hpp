#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/reloc/landmark_index.hpp"

namespace gslts::reloc {

/// Settings of the search for hypotheses.
struct HypothesisRule {
  int neighbours = 4;   ///< Landmarks that are considered for each feature, 1 to 16.
  int max_bits = 64;    ///< Maximum Hamming distance of a match, 0 to 256.
  double ratio = 0.85;  ///< Maximum ratio of the distances to the nearest landmark and to the next
                        ///< one elsewhere (Lowe 2004), for matches among all landmarks. (0, 1]
  double same_landmark_m = 0.1;  ///< Landmarks that are nearer to each other count as one, m. >= 0
  int keyframes = 8;             ///< Keyframes that are tried one by one, by votes. >= 0
  double inlier_px = 4.0;        ///< Maximum reprojection error of an inlier, px. > 0
  double inlier_depth = 0.05;    ///< Maximum relative error of its measured depth. > 0
  int min_inliers = 10;          ///< Minimum number of inliers of a hypothesis. >= 4
  int iterations = 500;          ///< Maximum number of poses that each RANSAC tries. > 0
};

/// A pose that some features support.
struct Hypothesis {
  Eigen::Isometry3d world_from_camera;
  int inliers;   ///< Keypoints that it explains; one found at several levels counts once.
  int keyframe;  ///< Keyframe whose landmarks gave it; -1 for all landmarks.
};

/// Finds poses from which an image may have been taken. Features are matched with all landmarks by
/// the ratio test, and with the landmarks of each keyframe that many features vote for, so that
/// places which look alike give several poses. From each set of matches RANSAC finds a pose, from
/// three points with measured depth (Umeyama 1991) or by P3P (Gao et al. 2003), which is refined
/// over all features that it explains. The same input always gives the same poses.
/// @param camera  Intrinsics of the image; its pose is not used.
/// @param features  M features of the image.
/// @param depths  [M] z of the features, m; 0 or NaN where there is none.
/// @param index  Landmarks of the map.
/// @return  By descending number of inliers, without poses within 5 cm and 3 degrees of each other.
/// @throws std::invalid_argument  if the camera, a pixel or a setting is invalid.
std::vector<Hypothesis> hypotheses_of(const Camera& camera, const Features& features,
                                      const float* depths, const LandmarkIndex& index,
                                      const HypothesisRule& rule = {});

}  // namespace gslts::reloc
