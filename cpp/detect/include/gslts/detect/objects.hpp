#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "gslts/detect/gs_lts_rule.hpp"
#include "gslts/detect/masks.hpp"
#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"

namespace gslts::detect {

/// Thresholds that separate objects that changed from errors of sensor, pose and map.
///
/// A surface counts as nearer than that of the other image if it is so by `step_sigmas` standard
/// deviations of the depth, the constant part measured across the surface, plus the change of its
/// depth within `step_px` pixels.
struct ObjectRule {
  double step_sigmas = 3;
  double step_px = 1;                ///< px
  int edge_tolerance_px = 2;         ///< By which edges may be misplaced, px.
  double min_area_m2 = 6e-4;         ///< Minimum area facing the camera, m^2.
  int min_area_px = 25;              ///< Minimum area of a part of a surface, px.
  double min_flat_area_m2 = 1.5e-3;  ///< Minimum area of a flat change, m^2.
  double min_flat_color = 0.15;    ///< Minimum colour change of a flat change, sum of the channels.
  double min_flat_step_m = 0.006;  ///< Minimum median depth difference that tells its side, m.
  double min_flat_contrast = 0.03;  ///< Minimum difference of brightness a px across its outline.
  double min_match_score = 0.3;     ///< Minimum `match_score` of the ends of a relocation.
  double min_confidence = 0.5;      ///< Minimum confidence of a reported change.
};

/// @throws std::invalid_argument  naming the function, if a setting is out of range.
void validate(const ObjectRule& rule, const char* function);

struct Surfaces {
  std::vector<Surface> surfaces;
  Array<std::int32_t> labels;  ///< [H,W] 0 where nothing changed.
};

/// An object that was added, removed or relocated.
struct ObjectChange {
  ChangeType type;
  double confidence;              ///< 0 to 1.
  std::optional<Surface> before;  ///< In the map; not for an addition.
  std::optional<Surface> after;   ///< In the frame; not for a removal.
};

/// Finds the surfaces that only one of map and frame shows.
///
/// A surface of the frame that is nearer than all of the map's around it has appeared; a surface of
/// the map that is nearer than the frame's has vanished. A flat change (a book, a sheet of paper)
/// has no such step: its colours do not occur around it in the other image, and depth, colours or
/// outline decide in which image it lies.
/// @param masks  Of the same views.
/// @throws std::invalid_argument  if the camera, the noise of the depth or a setting is invalid.
Surfaces find_changed_surfaces(const Views& views, const Masks& masks, const ObjectRule& rule);

/// Classifies surfaces as additions, removals and relocations: what vanished and what appeared are
/// one object if they match in colours and size.
/// @return  Changes with at least `min_confidence`, the highest confidence first.
/// @throws std::invalid_argument  if a setting or a surface is invalid.
std::vector<ObjectChange> classify_changes(const std::vector<Surface>& surfaces,
                                           const ObjectRule& rule);

}  // namespace gslts::detect
