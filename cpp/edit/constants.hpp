#pragma once

#include <cstdint>

// Fixed numbers of the editing of a map. Margins that a user may change are in `VoteRule` and
// `DepthTolerance`.

namespace gslts::edit {

/// Maximum index of a cell of the grids of `thin_points`, along each axis: points farther away
/// share a cell. Up to it a double holds a coordinate within 2^-26 of a cell, less than the 2^-24
/// by which a cell is wider than a spacing: neighbours are in neighbouring cells.
constexpr double kMaxCell = 1 << 28;

/// Multipliers of the spatial hash of a cell (Teschner et al. 2003).
constexpr std::uint64_t kHashX = 73856093, kHashY = 19349663, kHashZ = 83492791;

}  // namespace gslts::edit
