#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "images.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "kernels.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Sets the pixels of a tile to 0 in all images.
template <typename T>
void clear_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, Images<T>& images) {
  const int x0 = tile.x * kTileSize, y0 = tile.y * kTileSize;
  const int y1 = std::min(y0 + kTileSize, setup.height);
  const std::size_t columns = std::size_t(std::min(kTileSize, setup.width - x0));
  const std::size_t dims = std::size_t(setup.feature_dims);
  for (int y = y0; y < y1; ++y) {
    const std::size_t at = std::size_t(y) * setup.width + x0;
    std::fill_n(images.rgb.data() + 3 * at, 3 * columns, T(0));
    std::fill_n(images.depth.data() + at, columns, T(0));
    std::fill_n(images.alpha.data() + at, columns, T(0));
    std::fill_n(images.features.data() + dims * at, dims * columns, T(0));
  }
}

/// Colours, depths and alphas of up to kBlockSize pixels of a row.
template <class D>
struct RowPixels {
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;
  V red, green, blue, depth, alpha;

  /// C = sum w c + (1 - alpha) background and z = sum w z / alpha.
  /// @param sums  Of the pixels, as `blend_tile` left them.
  /// @param seen  0 where a pixel is not wanted and must not show the background, else 1.
  HWY_INLINE RowPixels(D d, const RenderSetup<T>& setup, const T* sums, V seen) {
    const V zero = hn::Zero(d), one = hn::Set(d, T(1));
    const auto sum = [&](std::size_t channel)
                         HWY_ATTR { return hn::LoadU(d, sums + channel * kBlockPixels); };
    alpha = hn::Min(sum(4), one);  // Rounding may leave the sum an ulp above.
    const V behind = seen - alpha;
    red = hn::MulAdd(behind, hn::Set(d, setup.background[0]), sum(0));
    green = hn::MulAdd(behind, hn::Set(d, setup.background[1]), sum(1));
    blue = hn::MulAdd(behind, hn::Set(d, setup.background[2]), sum(2));
    const auto blended = hn::Gt(alpha, zero);
    depth = hn::IfThenElseZero(blended, sum(3) / hn::IfThenElse(blended, alpha, one));
  }

  /// Stores the first `count` pixels from pixel `at` of the images on.
  HWY_INLINE void store(D d, std::size_t count, std::size_t at, Images<T>& images) const {
    if (count == hn::Lanes(d)) {
      hn::StoreInterleaved3(red, green, blue, d, images.rgb.data() + 3 * at);
      hn::StoreU(depth, d, images.depth.data() + at);
      hn::StoreU(alpha, d, images.alpha.data() + at);
      return;
    }
    HWY_ALIGN T rgb[3 * kBlockSize], depths[kBlockSize], alphas[kBlockSize];
    hn::StoreInterleaved3(red, green, blue, d, rgb);
    hn::Store(depth, d, depths);
    hn::Store(alpha, d, alphas);
    std::copy_n(rgb, 3 * count, images.rgb.data() + 3 * at);
    std::copy_n(depths, count, images.depth.data() + at);
    std::copy_n(alphas, count, images.alpha.data() + at);
  }
};

/// 1 where a pixel of a row is wanted, else 0.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<D> wanted_flags(D d, const WantedPixels& wanted, int x, int y,
                                   std::size_t count) {
  HWY_ALIGN T flags[kBlockSize] = {};
  for (std::size_t i = 0; i < count; ++i) flags[i] = T(wanted.pixel(x + int(i), y));
  return hn::Load(d, flags);
}

template <typename T>
void write_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Images<T>& images) {
  if (!tile.wanted) {
    clear_tile(tile, setup, images);
    return;
  }
  const hn::CappedTag<T, kBlockSize> d;
  const std::size_t lanes = hn::Lanes(d), dims = std::size_t(setup.feature_dims);
  const bool has_background =
      std::any_of(setup.background, setup.background + 3, [](T value) { return value != T(0); });
  static const T nothing[5 * kBlockPixels] = {};
  const int x0 = tile.x * kTileSize, y0 = tile.y * kTileSize;
  const int x1 = std::min(x0 + kTileSize, setup.width);
  const int y1 = std::min(y0 + kTileSize, setup.height);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; x += int(lanes)) {
      const std::size_t pixel = (y - y0) % kBlockSize * kBlockSize + (x - x0) % kBlockSize;
      const int block = (y - y0) / kBlockSize * kBlocksPerRow + (x - x0) / kBlockSize;
      const T* sums =
          tile.count ? tile.sums + std::size_t(block) * (5 + dims) * kBlockPixels : nothing;
      const std::size_t count = std::min(lanes, std::size_t(x1 - x));
      const std::size_t at = std::size_t(y) * setup.width + x;
      const auto seen =
          has_background && !wanted.all() ? wanted_flags(d, wanted, x, y, count) : hn::Set(d, T(1));
      RowPixels<hn::CappedTag<T, kBlockSize>>(d, setup, sums + pixel, seen)
          .store(d, count, at, images);
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < dims; ++k) {
          images.features[(at + i) * dims + k] =
              tile.count ? sums[(5 + k) * kBlockPixels + pixel + i] : T(0);
        }
      }
    }
  }
}

auto write_tile_float() { return &HWY_NAMESPACE::write_tile<float>; }
auto write_tile_double() { return &HWY_NAMESPACE::write_tile<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(write_tile_float);
HWY_EXPORT(write_tile_double);

template <>
void write_tile(const TileTask<float>& tile, const RenderSetup<float>& setup,
                const WantedPixels& wanted, Images<float>& images) {
  HWY_DYNAMIC_DISPATCH(write_tile_float)()(tile, setup, wanted, images);
}
template <>
void write_tile(const TileTask<double>& tile, const RenderSetup<double>& setup,
                const WantedPixels& wanted, Images<double>& images) {
  HWY_DYNAMIC_DISPATCH(write_tile_double)()(tile, setup, wanted, images);
}

}  // namespace gslts::raster
#endif
