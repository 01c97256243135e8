#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// A mask that votes for the Gaussians to remove.
struct VotingView {
  Camera camera;
  const std::uint8_t* mask;  ///< [H,W] M_comb; not 0 where the image shows what changed.
  /// [H,W] z of the map's surface in the camera frame, m; 0 where there is none. Null: hidden
  /// Gaussians get votes too, as in GS-LTS.
  const float* rendered_depth;
};

/// Maximum distance behind the rendered surface at which a Gaussian still belongs to it: behind_m +
/// behind_share depth. Farther behind it is hidden.
struct VoteRule {
  double behind_m = 0.04;      ///< m
  double behind_share = 0.02;  ///< Share of the rendered depth.
};

/// Votes for N Gaussians.
struct Votes {
  Array<std::int32_t> votes;  ///< [N] views in whose mask the centre lies: V(g).
  Array<std::int32_t> views;  ///< [N] views in which the centre is seen.
};

/// Counts the views in whose mask each Gaussian's centre is seen: V(g_i) = sum_k I[pi(T_k mu_i) in
/// M_comb,k].
///
/// With a null `rendered_depth` this is the rule of GS-LTS as printed, in which a cup's mask votes
/// for the wall behind it as well. With the rendered depth a Gaussian is seen only where it is in
/// front of, or near, the rendered surface.
/// @throws std::invalid_argument  if the Gaussians, a camera or the rule are not valid, or a view
///   has no mask.
///
/// Source: GS-LTS, sec. III-D2, eq. 11, after GaussianEditor (Chen et al. 2024).
Votes count_votes(const GaussianView<float>& gaussians, const std::vector<VotingView>& views,
                  const VoteRule& rule);

}  // namespace gslts::edit
