#include "setup.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

template <typename Value>
void require(bool ok, const char* name, const char* rule, Value value) {
  if (ok) return;
  std::ostringstream message;
  message << "Rasterizer::forward: options." << name << " must be " << rule << ", got " << value;
  throw std::invalid_argument(message.str());
}

/// @tparam T  Type in which the kernels use the options.
template <typename T>
void validate(const RenderOptions& options) {
  const auto require_finite = [](double used, const char* name, double value) {
    require(std::isfinite(T(used)), name, sizeof(T) == 4 ? "finite in float32" : "finite", value);
  };
  for (double value : options.background) require_finite(value, "background", value);
  require(options.near_m > 0, "near_m", "positive", options.near_m);
  require_finite(options.near_m, "near_m", options.near_m);
  require(options.far_m > options.near_m, "far_m", "greater than near_m", options.far_m);
  require(options.near_sigmas >= 0, "near_sigmas", "at least 0", options.near_sigmas);
  require_finite(options.near_sigmas * options.near_sigmas, "near_sigmas", options.near_sigmas);
  require(options.sh_degree >= 0 && options.sh_degree <= 3, "sh_degree", "0, 1, 2 or 3",
          options.sh_degree);
  require(options.eps2d_px2 >= 0, "eps2d_px2", "at least 0", options.eps2d_px2);
  require_finite(options.eps2d_px2, "eps2d_px2", options.eps2d_px2);
  require(options.alpha_min >= 1e-30 && options.alpha_min < kMaxAlpha, "alpha_min",
          "in [1e-30, 0.99)", options.alpha_min);
  require(options.exp_degree == 3 || options.exp_degree == 5, "exp_degree", "3 or 5",
          options.exp_degree);
  require(options.transmittance_min >= 0 && options.transmittance_min < 1, "transmittance_min",
          "in [0, 1)", options.transmittance_min);
}

/// Binary logarithm of a positive number, with the same bits on every machine; that of a C library
/// may differ in the last one.
double log2_of(double value) {
  int exponent = 0;
  double mantissa = std::frexp(value, &exponent);  // In [1/2, 1).
  if (mantissa < 0.70710678118654752) {
    mantissa *= 2;
    --exponent;
  }
  // ln m = 2 artanh((m - 1) / (m + 1)); the 12th power of s^2 <= 0.0295 is below 1e-18.
  const double s = (mantissa - 1) / (mantissa + 1);
  double series = 0;
  for (int k = 11; k >= 0; --k) series = series * s * s + 1.0 / (2 * k + 1);
  return exponent + 2 * s * series / kLn2;
}

/// Sets the pose. World coordinates may be huge: they meet only here, in double.
template <typename T>
void set_pose(const Camera& camera, const Eigen::Vector3d& map_origin, RenderSetup<T>& setup) {
  const Eigen::Matrix3d world_from_camera = camera.world_from_camera.linear();
  const Eigen::Vector3d camera_in_map = camera.world_from_camera.translation() - map_origin;
  for (int i = 0; i < 3; ++i) {
    double origin_in_camera = 0;  // Summed here: Eigen's order depends on the machine.
    for (int j = 0; j < 3; ++j) {
      setup.camera_from_map[i][j] = T(world_from_camera(j, i));
      origin_in_camera -= world_from_camera(j, i) * camera_in_map(j);
    }
    setup.map_origin_in_camera[i] = T(origin_in_camera);
    setup.camera_in_map[i] = T(camera_in_map(i));
  }
}

/// Sets the intrinsics and the size of the image.
template <typename T>
void set_projection(const Camera& camera, RenderSetup<T>& setup) {
  setup.fx = T(camera.fx);
  setup.fy = T(camera.fy);
  setup.cx = T(camera.cx);
  setup.cy = T(camera.cy);
  const double margin_x = kJacobianMargin * 0.5 * camera.width / camera.fx;
  const double margin_y = kJacobianMargin * 0.5 * camera.height / camera.fy;
  setup.min_tan_x = T(-camera.cx / camera.fx - margin_x);
  setup.max_tan_x = T((camera.width - camera.cx) / camera.fx + margin_x);
  setup.min_tan_y = T(-camera.cy / camera.fy - margin_y);
  setup.max_tan_y = T((camera.height - camera.cy) / camera.fy + margin_y);
  setup.width = camera.width;
  setup.height = camera.height;
  setup.tiles_x = (camera.width + kTileSize - 1) / kTileSize;
  setup.tiles_y = (camera.height + kTileSize - 1) / kTileSize;
  setup.region = {0, 0, camera.width, camera.height};
}

template <typename T>
void set_options(const RenderOptions& options, RenderSetup<T>& setup) {
  for (int i = 0; i < 3; ++i) setup.background[i] = T(options.background[i]);
  setup.min_color = options.clamp_colors ? T(0) : -std::numeric_limits<T>::infinity();
  setup.near_m = T(options.near_m);
  setup.far_m = T(options.far_m);
  setup.near_variances = T(options.near_sigmas * options.near_sigmas);
  setup.eps2d_px2 = T(options.eps2d_px2);
  setup.alpha_min = T(options.alpha_min);
  setup.log2_alpha_min = T(log2_of(options.alpha_min));
  // Positive: the negative transmittance of a pixel that is not wanted may underflow to -0.
  setup.transmittance_min = std::max(T(options.transmittance_min), std::numeric_limits<T>::min());
  setup.antialias = options.antialias;
  setup.surface_depth = options.surface_depth;
  setup.exp_degree = options.exp_degree;
  setup.threads = parallel::resolve_threads(options.threads);
}

int degree_of(int sh_bases) {
  return sh_bases >= 16 ? 3 : sh_bases >= 9 ? 2 : sh_bases >= 4 ? 1 : 0;
}

}  // namespace

template <typename T>
RenderSetup<T> make_setup(const GaussianView<T>& gaussians, const Camera& camera,
                          const RenderOptions& options) {
  gslts::validate(camera, "Rasterizer::forward");
  validate<T>(options);
  RenderSetup<T> setup;
  set_pose(camera, gaussians.origin, setup);
  set_projection(camera, setup);
  set_options(options, setup);
  setup.sh_degree = std::min(degree_of(gaussians.sh_bases), options.sh_degree);
  setup.sh_bases = gaussians.sh_bases;
  setup.feature_dims = gaussians.feature_dims;
  return setup;
}

WantedPixels::WantedPixels(const PixelMask& mask, int width, int height, const char* function)
    : width_(width) {
  validate(mask, width, height, function);
  if (mask.all()) return;
  pixels_.assign(mask.data, mask.data + std::size_t(width) * height);
  const int tiles_x = (width + kTileSize - 1) / kTileSize;
  const int tiles_y = (height + kTileSize - 1) / kTileSize;
  blocks_.assign(std::size_t(tiles_x) * tiles_y, 0);
  bounds_ = {width, height, 0, 0};
  const auto is_wanted = [](std::uint8_t pixel) { return pixel != 0; };
  for (int y = 0; y < height; ++y) {
    const std::uint8_t *row = pixels_.data() + std::size_t(y) * width, *end = row + width;
    std::uint64_t* tiles = blocks_.data() + std::size_t(y / kTileSize) * tiles_x;
    const int first_bit = y % kTileSize / kBlockSize * kBlocksPerRow;
    const int first = int(std::find_if(row, end, is_wanted) - row);
    if (first == width) continue;
    const auto last =
        std::find_if(std::make_reverse_iterator(end), std::make_reverse_iterator(row), is_wanted);
    const int row_end = int(last.base() - row);
    bounds_ = {std::min(bounds_.x0, first), std::min(bounds_.y0, y), std::max(bounds_.x1, row_end),
               y + 1};
    for (int x = first / kBlockSize * kBlockSize; x < row_end; x += kBlockSize) {
      std::uint32_t block = 0;
      std::memcpy(&block, row + x, std::size_t(std::min(kBlockSize, width - x)));
      const int bit = first_bit + x % kTileSize / kBlockSize;
      tiles[x / kTileSize] |= std::uint64_t{block != 0} << bit;
    }
  }
  if (bounds_.x1 == 0) bounds_ = {};
}

template RenderSetup<float> make_setup(const GaussianView<float>&, const Camera&,
                                       const RenderOptions&);
template RenderSetup<double> make_setup(const GaussianView<double>&, const Camera&,
                                        const RenderOptions&);

}  // namespace gslts::raster
