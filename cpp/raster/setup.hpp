#pragma once

#include <cstdint>
#include <vector>

#include "constants.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::raster {

/// Half-open rectangle of tiles or pixels.
struct Rect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Camera, options and map as the kernels need them: computed once in double, kept in T.
template <typename T>
struct RenderSetup {
  T camera_from_map[3][3];                       ///< Rotation.
  T map_origin_in_camera[3];                     ///< m
  T camera_in_map[3];                            ///< Camera centre, m.
  T fx, fy, cx, cy;                              ///< px
  T min_tan_x, max_tan_x, min_tan_y, max_tan_y;  ///< Limits of x/z and y/z in the Jacobian.
  T near_m, far_m, near_variances;               ///< The last is the square of near_sigmas.
  T eps2d_px2;
  T alpha_min, log2_alpha_min, transmittance_min;
  T background[3];
  T min_color;  ///< Colours below it are raised to it.
  bool antialias;
  bool surface_depth;
  int exp_degree;
  int sh_degree;  ///< min(map, option)
  int sh_bases;   ///< of the map's array
  int feature_dims;
  int width, height;
  int tiles_x, tiles_y;
  int threads;
  Rect region;  ///< Bounding box of the wanted pixels.
};

/// @throws std::invalid_argument  for a bad camera or option.
template <typename T>
RenderSetup<T> make_setup(const GaussianView<T>& gaussians, const Camera& camera,
                          const RenderOptions& options);

/// The wanted pixels, by tile and block. Empty when there is no mask: then all are wanted.
class WantedPixels {
 public:
  WantedPixels() = default;
  /// @throws std::invalid_argument  naming the caller, if the mask's size is not that of the image.
  WantedPixels(const PixelMask& mask, int width, int height, const char* function);

  bool all() const { return pixels_.empty(); }
  /// Bit b is set if a pixel of block b of the tile is wanted; bits outside the image may be set.
  std::uint64_t blocks(int tile) const { return all() ? ~std::uint64_t{0} : blocks_[tile]; }
  bool pixel(int x, int y) const { return all() || pixels_[std::size_t(y) * width_ + x]; }
  Rect bounds() const { return bounds_; }

 private:
  int width_ = 0;
  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint64_t> blocks_;
  Rect bounds_;
};

}  // namespace gslts::raster
