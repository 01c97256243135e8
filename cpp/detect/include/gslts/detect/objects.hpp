#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "gslts/detect/masks.hpp"
#include "gslts/detect/paper_rule.hpp"
#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"
#include "gslts/map/array.hpp"

namespace gslts::detect {

/// How changed objects are told from errors of sensor, pose and map.
struct ObjectRule {
  double step_m = 0.025;         ///< A surface counts as nearer by so much, across it,
  double step_per_m = 0.006;     ///< by so much more times the square of its depth in m,
  double step_px = 1;            ///< and by what its depth changes within so many pixels.
  int reach_px = 2;              ///< By which edges may be misplaced.
  double least_area_m2 = 6e-4;   ///< Smaller surfaces, facing the camera, are no objects.
  int least_area_px = 25;        ///< Nor are smaller parts of the image.
  double flat_area_m2 = 1.5e-3;  ///< The same where colours alone differ,
  double flat_color = 0.15;      ///< summed over the channels, from all that is around.
  double flat_step_m = 0.006;    ///< A mean difference of depths that tells the side.
  double least_contrast = 0.03;  ///< Of brightness a pixel, across the outline of a flat object.
  double alike = 0.25;           ///< How likely the ends of a relocation must be one object.
  double certain = 0.5;          ///< Less likely changes are not reported.
};

/// @throws std::invalid_argument  naming the function, if a setting is out of range.
void validate(const ObjectRule& rule, const char* function);

struct Surfaces {
  std::vector<Surface> surfaces;
  Array<std::int32_t> labels;  ///< [H,W] 0 where nothing changed.
};

/// An object that is somewhere else, or is new, or is gone.
struct ObjectChange {
  ChangeType type;
  double confidence;              ///< 0 to 1.
  std::optional<Surface> before;  ///< In the map; not for an addition.
  std::optional<Surface> after;   ///< In the photo; not for a removal.
};

/// What only one of the two shows.
///
/// Where the photo's surface is nearer than the map's anywhere around, something appeared; where
/// the map's is nearer, something vanished. What lies flat has colours that the other image does
/// not show around; depth, colours or its outline tell in which image it is.
/// @param masks  Of the same views.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
Surfaces changed_surfaces(const Views& views, const Masks& masks, const ObjectRule& rule);

/// The changes that explain some surfaces, the most certain first: what vanished and what appeared
/// are one object if they are alike in colours and size.
/// @throws std::invalid_argument  if a setting is invalid.
std::vector<ObjectChange> changes_of(const std::vector<Surface>& surfaces, const ObjectRule& rule);

}  // namespace gslts::detect
