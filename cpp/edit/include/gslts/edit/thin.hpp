#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::edit {

/// Rows of the points that stay when each, in order, must keep a distance from those before it.
///
/// @param points  [count,3] m.
/// @param spacing_m  [count] that a point keeps from all that stay before it.
/// @throws std::invalid_argument  if a point is not finite, or a spacing is not positive and
/// finite.
Array<std::uint32_t> thinned(const float* points, const float* spacing_m, std::size_t count);

}  // namespace gslts::edit
