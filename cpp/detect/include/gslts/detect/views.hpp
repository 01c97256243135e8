#pragma once

#include <cstddef>

#include "gslts/map/camera.hpp"

namespace gslts::detect {

/// Standard deviation of the difference of measured and rendered depths of an unchanged surface:
/// constant_m + per_m depth^2. The defaults are for maps of which nothing is known.
struct DepthNoise {
  double constant_m = 0.0083;  ///< m
  double per_m = 0.002;        ///< 1/m
};

/// A frame and a rendering of the map from the same camera: images of one size, row by row.
struct Views {
  Camera camera;                ///< Camera of all images.
  const float* observed_rgb;    ///< [H,W,3] sRGB, 0 to 1.
  const float* rendered_rgb;    ///< [H,W,3] sRGB, with the exposure of the frame.
  const float* observed_depth;  ///< [H,W] z in the camera frame, m; 0 and NaN: not measured.
  const float* rendered_depth;  ///< [H,W] z in the camera frame, m; 0 where nothing is.
  const float* alpha;           ///< [H,W] opacity of the map, 0 to 1.
  const float* similarity;      ///< [H,W] cosine of the features of both images, -1 to 1.
  /// [H,W] expected errors of the rendered depth, m, and of the rendered colours, summed over the
  /// channels; null if they are not known.
  const float* depth_error = nullptr;
  const float* color_error = nullptr;
  DepthNoise noise = {};

  std::size_t size() const { return std::size_t(camera.width) * std::size_t(camera.height); }
};

}  // namespace gslts::detect
