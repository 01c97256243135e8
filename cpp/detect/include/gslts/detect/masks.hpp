#pragma once

#include <cstdint>

#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"

namespace gslts::detect {

/// Thresholds of the masks of GS-LTS, sec. III-C. Their values are not in the paper; these serve
/// its rule best in simulated homes (benchmarks/results/detection.md).
struct MaskRule {
  double tau_gs = 0.15;    ///< Sum over the channels of absolute differences, 0 to 3.
  double tau_feat = 0.95;  ///< Cosine of the features below which they differ.
  double alpha_min = 0.7;  ///< Minimum opacity of the map where it is known.
  int clean_px = 2;        ///< Radius, px, of the opening and closing of the combined mask.
};

/// [H,W] each, 1 where it holds and 0 elsewhere.
struct Masks {
  Array<std::uint8_t> known;     ///< The map is known there.
  Array<std::uint8_t> pixel;     ///< M_pixel: colours differ.
  Array<std::uint8_t> feature;   ///< M_feat: features differ.
  Array<std::uint8_t> combined;  ///< M_comb: both do, cleaned, where the map is known.
};

/// Computes the two branches of change detection and their product (GS-LTS, sec. III-C1, eq. 4 and
/// 5).
///
/// The paper prints M_feat = (similarity > tau_feat), which marks what did not change; here
/// features differ where their similarity is low.
/// @throws std::invalid_argument  if the camera or a threshold is invalid.
Masks compute_masks(const Views& views, const MaskRule& rule);

}  // namespace gslts::detect
