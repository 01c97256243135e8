#pragma once

#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::plan {

/// Computes the length of the shortest path from each cell of a grid to the nearest goal, by fast
/// marching of second order (Sethian 1999). Paths bend anywhere, but do not cut corners.
/// @param free  [rows,columns] 1 where a path may pass, else 0.
/// @param goals  [rows,columns] 1 at goals; those that are not free are ignored.
/// @param cell_m  Edge of a cell, m. Positive.
/// @return  [rows,columns] m; infinite where there is no path.
/// @throws std::invalid_argument  if a size is negative or too large, or the edge not positive.
Array<double> distance_field(const std::uint8_t* free, const std::uint8_t* goals, int rows,
                             int columns, double cell_m);

}  // namespace gslts::plan
