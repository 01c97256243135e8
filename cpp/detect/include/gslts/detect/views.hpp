#pragma once

#include <cstddef>

#include "gslts/map/camera.hpp"

namespace gslts::detect {

/// A frame and a rendering of the map from the same camera: images of one size, row by row.
struct Views {
  Camera camera;                ///< Camera of all images.
  const float* observed_rgb;    ///< [H,W,3] sRGB, 0 to 1.
  const float* rendered_rgb;    ///< [H,W,3] sRGB, with the exposure of the frame.
  const float* observed_depth;  ///< [H,W] z in the camera frame, m; 0 and NaN: not measured.
  const float* rendered_depth;  ///< [H,W] z in the camera frame, m; 0 where nothing is.
  const float* alpha;           ///< [H,W] opacity of the map, 0 to 1.
  const float* similarity;      ///< [H,W] cosine of the features of both images, -1 to 1.

  std::size_t size() const { return std::size_t(camera.width) * std::size_t(camera.height); }
};

}  // namespace gslts::detect
