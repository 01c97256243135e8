#pragma once

#include <cstdint>

#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"

namespace gslts::detect {

/// Where a photo and a rendering differ, named as in GS-LTS, sec. III-C. The thresholds are not in
/// the paper; these serve its rule best in simulated homes: benchmarks/results/detection.md.
struct MaskRule {
  double tau_gs = 0.15;    ///< Sum over the channels of absolute differences, 0 to 3.
  double tau_feat = 0.95;  ///< Cosine of the features below which they differ.
  double alpha_min = 0.7;  ///< Where less of the map is, it was never seen.
  int clean_px = 2;        ///< Radius by which specks are opened, and cracks closed.
};

/// [H,W] each, 1 where it holds and 0 elsewhere.
struct Masks {
  Array<std::uint8_t> known;     ///< The map was seen there.
  Array<std::uint8_t> pixel;     ///< M_pixel: colours differ.
  Array<std::uint8_t> feature;   ///< M_feat: features differ.
  Array<std::uint8_t> combined;  ///< M_comb: both do, cleaned, where the map is known.
};

/// The dual branch of GS-LTS. The paper prints M_feat = (similarity > tau_feat), which marks what
/// did not change; here features differ where their similarity is low.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
Masks masks_of(const Views& views, const MaskRule& rule);

}  // namespace gslts::detect
