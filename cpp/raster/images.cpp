#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "images.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "kernels.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

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

template <typename T>
void write_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Images<T>& images) {
  if (!tile.wanted) {
    clear_tile(tile, setup, images);
    return;
  }
  const hn::CappedTag<T, kBlockSize> d;
  using V = hn::Vec<hn::CappedTag<T, kBlockSize>>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t dims = std::size_t(setup.feature_dims);
  const V zero = hn::Zero(d), one = hn::Set(d, T(1));
  const V background[3] = {hn::Set(d, setup.background[0]), hn::Set(d, setup.background[1]),
                           hn::Set(d, setup.background[2])};
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
      const auto sum = [&](std::size_t channel)
                           HWY_ATTR { return hn::LoadU(d, sums + channel * kBlockPixels + pixel); };
      const std::size_t columns = std::min(lanes, std::size_t(x1 - x));
      V seen = one;  // 0 where a pixel is not wanted and must not show the background.
      if (has_background && !wanted.all()) {
        HWY_ALIGN T flags[kBlockSize] = {};
        for (std::size_t i = 0; i < columns; ++i) flags[i] = T(wanted.pixel(x + int(i), y));
        seen = hn::Load(d, flags);
      }
      const V alpha = hn::Min(sum(4), one);  // Rounding may leave the sum an ulp above.
      const V behind = seen - alpha;
      const V red = hn::MulAdd(behind, background[0], sum(0));
      const V green = hn::MulAdd(behind, background[1], sum(1));
      const V blue = hn::MulAdd(behind, background[2], sum(2));
      const auto blended = hn::Gt(alpha, zero);
      const V depth = hn::IfThenElseZero(blended, sum(3) / hn::IfThenElse(blended, alpha, one));
      const std::size_t at = std::size_t(y) * setup.width + x;
      if (columns == lanes) {
        hn::StoreInterleaved3(red, green, blue, d, images.rgb.data() + 3 * at);
        hn::StoreU(depth, d, images.depth.data() + at);
        hn::StoreU(alpha, d, images.alpha.data() + at);
      } else {
        HWY_ALIGN T rgb[3 * kBlockSize], depths[kBlockSize], alphas[kBlockSize];
        hn::StoreInterleaved3(red, green, blue, d, rgb);
        hn::Store(depth, d, depths);
        hn::Store(alpha, d, alphas);
        std::copy_n(rgb, 3 * columns, images.rgb.data() + 3 * at);
        std::copy_n(depths, columns, images.depth.data() + at);
        std::copy_n(alphas, columns, images.alpha.data() + at);
      }
      for (std::size_t i = 0; i < columns; ++i) {
        for (std::size_t k = 0; k < dims; ++k) {
          images.features[(at + i) * dims + k] =
              tile.count ? sums[(5 + k) * kBlockPixels + pixel + i] : T(0);
        }
      }
    }
  }
}

void write_tile_float(const TileTask<float>& tile, const RenderSetup<float>& setup,
                      const WantedPixels& wanted, Images<float>& images) {
  HWY_NAMESPACE::write_tile<float>(tile, setup, wanted, images);
}
void write_tile_double(const TileTask<double>& tile, const RenderSetup<double>& setup,
                       const WantedPixels& wanted, Images<double>& images) {
  HWY_NAMESPACE::write_tile<double>(tile, setup, wanted, images);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(write_tile_float);
HWY_EXPORT(write_tile_double);

template <>
void write_tile(const TileTask<float>& tile, const RenderSetup<float>& setup,
                const WantedPixels& wanted, Images<float>& images) {
  HWY_DYNAMIC_DISPATCH(write_tile_float)(tile, setup, wanted, images);
}
template <>
void write_tile(const TileTask<double>& tile, const RenderSetup<double>& setup,
                const WantedPixels& wanted, Images<double>& images) {
  HWY_DYNAMIC_DISPATCH(write_tile_double)(tile, setup, wanted, images);
}

}  // namespace gslts::raster
#endif
