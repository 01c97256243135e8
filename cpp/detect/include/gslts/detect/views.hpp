#pragma once

#include <cstddef>

#include "gslts/map/camera.hpp"

namespace gslts::detect {

/// What a camera saw, and what a map shows from there: images of one size, row by row.
struct Views {
  Camera camera;            ///< Of all images.
  const float* photo;       ///< [H,W,3] sRGB, 0 to 1.
  const float* rgb;         ///< [H,W,3] rendered, with the exposure of the photo.
  const float* measured;    ///< [H,W] depth, z in m; 0 and NaN mean no measurement.
  const float* rendered;    ///< [H,W] depth, z in m; 0 where nothing is.
  const float* alpha;       ///< [H,W] opacity of the map, 0 to 1.
  const float* similarity;  ///< [H,W] cosine of the features of both, -1 to 1.

  std::size_t size() const { return std::size_t(camera.width) * std::size_t(camera.height); }
};

}  // namespace gslts::detect
