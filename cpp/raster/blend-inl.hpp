// What the forward and the backward blending share. Included once per instruction set.

#if defined(GSLTS_RASTER_BLEND_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_BLEND_INL_HPP
#undef GSLTS_RASTER_BLEND_INL_HPP
#else
#define GSLTS_RASTER_BLEND_INL_HPP
#endif

#include <algorithm>

#include "kernels.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Entries between the one at work and the one whose splat is fetched from memory.
constexpr std::uint32_t kPrefetchDistance = 64;

/// Positions of the pixel centres of a block's vector `i` in its tile, px.
template <class D>
struct PixelCenters {
  hn::Vec<D> x, y;

  HWY_INLINE PixelCenters(D d, std::size_t block, std::size_t i)
      : x(hn::Load(d, kCenters.x[block % kBlocksPerRow] + i * hn::Lanes(d))),
        y(hn::Load(d, kCenters.y[block / kBlocksPerRow] + i * hn::Lanes(d))) {}

 private:
  using T = hn::TFromD<D>;
  struct Table {
    constexpr Table() : x(), y() {
      for (int block = 0; block < kBlocksPerRow; ++block) {
        for (int pixel = 0; pixel < kBlockPixels; ++pixel) {
          x[block][pixel] = T(block * kBlockSize + pixel % kBlockSize) + T(0.5);
          y[block][pixel] = T(block * kBlockSize + pixel / kBlockSize) + T(0.5);
        }
      }
    }
    alignas(64) T x[kBlocksPerRow][kBlockPixels];
    alignas(64) T y[kBlocksPerRow][kBlockPixels];
  };
  static constexpr Table kCenters{};
};

/// A splat as a tile sees it: u and v are linear in the position in the tile, so their values at
/// its corner take the place of the mean.
template <typename T>
struct TileSplat {
  T corner_u, corner_v;
  T uu, uv, vv;  ///< These and the rest as in `Splat`.
  T log2_opacity;
  T color[3];
  T depth, depth_u, depth_v;
  std::uint32_t gaussian;
};

/// u and v, as in `Splat`, at the corner of a tile.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void corner_uv(D d, V mean_x, V mean_y, V uu, V uv, V vv, int tile_x, int tile_y, V& u,
                          V& v) {
  using T = hn::TFromD<D>;
  const V x = hn::Set(d, T(tile_x * kTileSize)) - mean_x;
  const V y = hn::Set(d, T(tile_y * kTileSize)) - mean_y;
  u = hn::MulAdd(uv, y, uu * x);
  v = vv * y;
}

/// The same splat at one vector of pixels.
template <class D>
struct Footprint {
  using V = hn::Vec<D>;
  V u, v, log2_alpha;

  HWY_INLINE Footprint(V corner_u, V corner_v, V uu, V uv, V vv, V log2_opacity,
                       const PixelCenters<D>& at)
      : u(hn::MulAdd(uu, at.x, hn::MulAdd(uv, at.y, corner_u))),
        v(hn::MulAdd(vv, at.y, corner_v)),
        log2_alpha(hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, log2_opacity))) {}
};

/// Alpha from its logarithm; any value where that is far below every alpha_min.
template <int kExpDegree, class V>
HWY_INLINE V alpha_of(V log2_alpha) {
  const hn::DFromV<V> d;
  return hn::Min(exp2_nonpositive<kExpDegree>(d, log2_alpha), hn::Set(d, hn::TFromV<V>(kMaxAlpha)));
}

/// Sets the transmittance of the tile's wanted pixels to 1, and of all others to -1: they never
/// pass the test against transmittance_min. Returns the blocks that hold a wanted pixel.
template <typename T>
std::uint64_t start_transmittance(const TileTask<T>& tile, const RenderSetup<T>& setup,
                                  const WantedPixels& wanted, T* transmittance) {
  const int x0 = tile.x * kTileSize, y0 = tile.y * kTileSize;
  const bool whole =
      wanted.all() && x0 + kTileSize <= setup.width && y0 + kTileSize <= setup.height;
  std::fill(transmittance, transmittance + kBlocksPerTile * kBlockPixels, whole ? T(1) : T(-1));
  if (whole) return ~std::uint64_t{0};
  std::uint64_t alive = 0;
  const int x1 = std::min(x0 + kTileSize, setup.width);
  const int y1 = std::min(y0 + kTileSize, setup.height);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      if (!wanted.pixel(x, y)) continue;
      const int block = (y - y0) / kBlockSize * kBlocksPerRow + (x - x0) / kBlockSize;
      const int pixel = (y - y0) % kBlockSize * kBlockSize + (x - x0) % kBlockSize;
      transmittance[block * kBlockPixels + pixel] = T(1);
      alive |= std::uint64_t{1} << block;
    }
  }
  return alive;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
