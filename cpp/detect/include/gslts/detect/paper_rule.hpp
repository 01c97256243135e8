#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "gslts/detect/components.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect {

enum class ChangeType { kAddition, kRemoval, kRelocation };

/// Thresholds of GS-LTS, sec. III-C, chosen as those of `MaskRule`.
struct PaperRule {
  double tau_change = 0.0002;  ///< Share of the image that M_comb must exceed.
  double tau_a = 0.5;          ///< Area similarity of a relocation's two regions.
  double tau_d = 1.0;          ///< Their distance, as a share of the width of the image.
  double epsilon = 0.02;       ///< Depth difference of an addition or a removal, m.
};

/// What the rule says, and why.
struct PaperChange {
  ChangeType type;
  Eigen::Vector3d point_in_world;   ///< p_world, m.
  Component first;                  ///< R_1
  std::optional<Component> second;  ///< R_2 of a relocation.
};

/// Change type and key point as printed in GS-LTS, sec. III-C: relocation by the two largest
/// components, otherwise addition or removal by the depths at the centroid of the largest one.
///
/// What the paper leaves open: a depth that is missing at a centroid counts as no difference, and
/// in the pseudo depth the other one is taken; without either there is no point, and no change.
/// @param components  Of M_comb.
/// @return Nothing if too little differs, or the depths do not.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
std::optional<PaperChange> paper_change(const Views& views, const Components& components,
                                        const PaperRule& rule);

}  // namespace gslts::detect
