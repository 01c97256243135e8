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
constexpr std::uint32_t kPrefetchDistance = 24;

/// Coordinates of the pixel centres of a tile's blocks, lane i being pixel (i % 4, i / 4).
template <typename T>
struct PixelCenters {
  PixelCenters(int tile_x, int tile_y) {
    for (int block = 0; block < kBlocksPerRow; ++block) {
      for (int pixel = 0; pixel < kBlockPixels; ++pixel) {
        const int offset = block * kBlockSize;
        x[block][pixel] = T(tile_x * kTileSize + offset + pixel % kBlockSize) + T(0.5);
        y[block][pixel] = T(tile_y * kTileSize + offset + pixel / kBlockSize) + T(0.5);
      }
    }
  }
  HWY_ALIGN T x[kBlocksPerRow][kBlockPixels];  ///< By column of blocks.
  HWY_ALIGN T y[kBlocksPerRow][kBlockPixels];  ///< By row of blocks.
};

/// A splat's parameters, broadcast to all lanes.
template <typename T>
struct Footprint {
  using D = Lanes<T>;
  using V = hn::Vec<D>;
  struct Sample {
    V u, v, log2_alpha;  ///< As in `Splat`.
  };

  explicit HWY_INLINE Footprint(const Splat<T>& splat)
      : mean_x(hn::Set(D(), splat.mean_x)),
        mean_y(hn::Set(D(), splat.mean_y)),
        uu(hn::Set(D(), splat.uu)),
        uv(hn::Set(D(), splat.uv)),
        vv(hn::Set(D(), splat.vv)),
        log2_opacity(hn::Set(D(), splat.log2_opacity)) {}

  /// At the pixels from `first` on of a block.
  HWY_INLINE Sample at(const PixelCenters<T>& centers, int block, std::size_t first) const {
    const D d;
    const V dx = hn::Load(d, centers.x[block % kBlocksPerRow] + first) - mean_x;
    const V dy = hn::Load(d, centers.y[block / kBlocksPerRow] + first) - mean_y;
    Sample s;
    s.u = hn::MulAdd(uv, dy, uu * dx);
    s.v = vv * dy;
    s.log2_alpha = hn::NegMulAdd(s.u, s.u, hn::NegMulAdd(s.v, s.v, log2_opacity));
    return s;
  }

  V mean_x, mean_y, uu, uv, vv, log2_opacity;
};

/// Alpha from its logarithm; any value where that is far below every alpha_min.
template <class V>
HWY_INLINE V alpha_of(V log2_alpha) {
  const hn::DFromV<V> d;
  return hn::Min(exp2_nonpositive(d, log2_alpha), hn::Set(d, hn::TFromV<V>(kMaxAlpha)));
}

/// Sets the transmittance of the tile's wanted pixels to 1, and of all others to -1: they never pass
/// the test against transmittance_min. Returns the blocks that hold a wanted pixel.
template <typename T>
std::uint64_t start_transmittance(const TileTask<T>& tile, const RenderSetup<T>& setup,
                                  const WantedPixels& wanted, T* transmittance) {
  const int x0 = tile.x * kTileSize, y0 = tile.y * kTileSize;
  const bool whole = wanted.all() && x0 + kTileSize <= setup.width && y0 + kTileSize <= setup.height;
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
