#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::edit {

/// Selects points that keep a distance from each other: each point, in order, is kept if no point
/// kept before it is nearer than its spacing.
/// @param points  [count,3] m.
/// @param spacing_m  [count] minimum distance of each point from those kept before it.
/// @return  Rows of the points kept, ascending.
/// @throws std::invalid_argument  if a point is not finite, or a spacing is not positive and
///   finite.
Array<std::uint32_t> thin_points(const float* points, const float* spacing_m, std::size_t count);

}  // namespace gslts::edit
