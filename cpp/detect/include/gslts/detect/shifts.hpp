#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "gslts/detect/masks.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect {

/// A small rigid motion over the floor: of a chair that was pushed, say, and of all that stands on
/// it.
struct Shift {
  std::vector<std::size_t> surfaces;  ///< Indices of the changed surfaces that it explains.
  Eigen::Isometry3d motion;           ///< World, m: x_after = motion * x_before.
  /// Mean share of their points that it explains, less those that contradict it.
  double score;
  Eigen::AlignedBox3d before, after;  ///< Around the points that were followed, world, m.
};

/// Finds shifts that explain surfaces which only one of map and frame shows.
///
/// A shift moves a point of the object to where another point of it was, and so on to its edge. So
/// each point of a surface of the map is moved again and again: the frame must show it at each
/// place, until one where the map showed something else. Points of the frame are moved back
/// likewise. An object that is gone, or that came, has no such motion.
/// @param masks  Of the same views.
/// @param surfaces  From `find_changed_surfaces`.
/// @param labels  [H,W] of the same call.
/// @return  Each surface belongs to one shift at most.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
std::vector<Shift> find_shifts(const Views& views, const Masks& masks,
                               const std::vector<Surface>& surfaces,
                               const Array<std::int32_t>& labels, const ObjectRule& rule);

}  // namespace gslts::detect
