#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "gslts/align/noise.hpp"

// Derivatives of a rendered image by the pose of its camera, to first order: the surface at a pixel
// moves in the image (Kerl et al. 2013, Dense Visual SLAM for RGB-D Cameras).

namespace gslts::align {

/// The surface that an image shows at a pixel.
template <typename T>
struct Surface {
  T point[3];    ///< In the camera frame, m; its z is above 0.
  T fx, fy;      ///< Focal lengths, in pixels of the image.
  T slope[3]{};  ///< Change of an image value per m of a shift of the camera; see `set_slope`.

  /// Derives `slope` from the central differences of an image, per pixel.
  void set_slope(T right, T down) {
    slope[0] = right * fx / point[2];
    slope[1] = down * fy / point[2];
    slope[2] = -(slope[0] * point[0] + slope[1] * point[1]) / point[2];
  }

  /// Turns the slope of depth into that of the relative depth `depth / unit`: a camera that comes
  /// nearer also changes the depth itself.
  void set_depth_slope(T right, T down, T unit) {
    set_slope(right, down);
    slope[2] -= 1;
    for (T& value : slope) value /= unit;
  }

  /// Writes the derivatives by a twist (rho, phi) of the camera, m before rad, to row[0..5].
  void write_twist(T* row) const {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      row[i] = slope[i];
      row[3 + i] = point[j] * slope[k] - point[k] * slope[j];
    }
  }
};

/// Central differences of an image at a pixel.
template <typename T>
struct Differences {
  T right, down;
};

/// @param image  Points to the value at the pixel.
/// @param step  Distance of values that are neighbours in a row.
/// @param width  Distance of values that are neighbours in a column.
template <typename T>
Differences<T> central_differences(const T* image, std::ptrdiff_t step, std::ptrdiff_t width) {
  return {(image[step] - image[-step]) / 2, (image[width] - image[-width]) / 2};
}

/// Returns true if the surface ends at a pixel: a neighbour's depth differs by more than the share
/// `kDepthEdge`.
/// @param depth  Points to the depth at the pixel.
template <typename T>
bool is_depth_edge(const T* depth, std::ptrdiff_t width) {
  T step = 0;
  for (const std::ptrdiff_t near : {std::ptrdiff_t(-1), std::ptrdiff_t(1), -width, width}) {
    step = std::max(step, std::abs(depth[near] - *depth));
  }
  return step > T(kDepthEdge) * *depth;
}

/// Sums of weighted normal equations J' W J and J' W r of N unknowns.
template <typename T, int N>
struct EquationSums {
  T hessian[N][N] = {};
  T right[N] = {};

  void add(const T (&row)[N], T residual, T weight) {
    for (int i = 0; i < N; ++i) {
      const T scaled = weight * row[i];
      for (int j = 0; j < N; ++j) hessian[i][j] += scaled * row[j];
      right[i] += scaled * residual;
    }
  }
};

}  // namespace gslts::align
