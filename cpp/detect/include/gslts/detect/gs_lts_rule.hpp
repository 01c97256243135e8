#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "gslts/detect/components.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect {

enum class ChangeType { kAddition, kRemoval, kRelocation };

/// Thresholds of the rule of GS-LTS, sec. III-C2, chosen as those of `MaskRule`.
struct GsLtsRule {
  double tau_change = 0.0002;  ///< Share of the image that M_comb must exceed.
  double tau_a = 0.5;          ///< Minimum area similarity of a relocation's two regions.
  double tau_d = 1.0;          ///< Maximum distance of them, as a share of the image's width.
  double epsilon = 0.02;       ///< Minimum depth difference of an addition or a removal, m.
};

/// A change as the rule of GS-LTS finds it.
struct GsLtsChange {
  ChangeType type;
  Eigen::Vector3d point_in_world;   ///< p_world, m.
  Component first;                  ///< R_1
  std::optional<Component> second;  ///< R_2 of a relocation.
};

/// Predicts change type and key point as printed in GS-LTS, sec. III-C2: relocation by the two
/// largest components, otherwise addition or removal by the depths at the centroid of the largest.
///
/// The paper leaves open what a missing depth does: at a centroid it counts as no difference, and
/// in the pseudo depth the other depth is taken; without either there is no point, and no change.
/// @param components  Of M_comb.
/// @return  Nothing if M_comb is too small, or the depths do not differ.
/// @throws std::invalid_argument  if the camera or a threshold is invalid.
std::optional<GsLtsChange> detect_gs_lts(const Views& views, const Components& components,
                                         const GsLtsRule& rule);

}  // namespace gslts::detect
