#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// A view that votes for what is to be removed.
struct VotingView {
  Camera camera;
  const std::uint8_t* mask;  ///< [H,W] not 0 where the image shows it.
  /// [H,W] depth of the map from there, z, m; 0 where nothing is. Null: what is hidden votes too.
  const float* rendered;
};

/// How far behind the surface that the map shows a Gaussian still belongs to it.
struct VoteRule {
  double behind_m = 0.04;      ///< At the camera,
  double behind_share = 0.02;  ///< and by so much of the depth more.
};

/// For N Gaussians.
struct Votes {
  Array<std::int32_t> votes;  ///< [N] views in whose mask the centre lies: V(g).
  Array<std::int32_t> views;  ///< [N] views in which the centre can be seen at all.
};

/// Counts the views in whose mask each Gaussian's centre is seen.
///
/// With a null `rendered` this is the voting function of GS-LTS as printed, in which a cup's mask
/// votes for the wall behind it as well. With the depth of the map a Gaussian is seen only where it
/// is in front of, or near, the surface that the map shows at its pixel.
///
/// @throws std::invalid_argument  if the Gaussians, a camera or the rule are not valid, or a view
///   has no mask.
///
/// Source: GS-LTS, sec. III-D, eq. of V(g_i), after GaussianEditor (Chen et al. 2024).
Votes votes_of(const GaussianView<float>& gaussians, const std::vector<VotingView>& views,
               const VoteRule& rule);

}  // namespace gslts::edit
