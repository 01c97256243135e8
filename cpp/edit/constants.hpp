#pragma once

#include <cstdint>

// Fixed numbers of the editing of a map. Margins that a user may change are in `VoteRule` and
// `DepthTolerance`.

namespace gslts::edit {

/// Maximum index of a cell of the grid of `thin_points`, along each axis: points farther away share
/// a cell, as a float could not tell neighbours apart there. Only speed depends on it.
constexpr double kMaxCell = 1e15;

/// Multipliers of the spatial hash of a cell (Teschner et al. 2003).
constexpr std::uint64_t kHashX = 73856093, kHashY = 19349663, kHashZ = 83492791;

}  // namespace gslts::edit
