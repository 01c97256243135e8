#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"

namespace gslts::detect {

/// Pixels of a mask that touch each other, also at their corners.
struct Component {
  int label;          ///< In the image of labels, from 1.
  int area;           ///< px
  int x, y;           ///< First column and row.
  int width, height;  ///< Size of the bounding box, px.
  double u, v;        ///< Centroid, px; the centre of the first pixel is (0.5, 0.5).
};

struct Components {
  std::vector<Component> components;  ///< By area, the largest first; then row by row.
  Array<std::int32_t> labels;         ///< [H,W] 0 where the mask is 0.
};

/// Finds the connected components of a mask.
/// @param mask  [H,W] 0 or not.
/// @throws std::invalid_argument  if a size is not positive.
Components connected_components(const std::uint8_t* mask, int width, int height);

}  // namespace gslts::detect
