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

/// Position of each block in its tile, px.
template <typename T>
struct BlockOffsets {
  constexpr BlockOffsets() : x(), y() {
    for (int block = 0; block < kBlocksPerTile; ++block) {
      x[block] = T(block % kBlocksPerRow * kBlockSize);
      y[block] = T(block / kBlocksPerRow * kBlockSize);
    }
  }
  T x[kBlocksPerTile], y[kBlocksPerTile];
};
template <typename T>
constexpr BlockOffsets<T> kBlockOffsets{};

/// A splat over one tile: u and v are linear, so their values in the tile's first block, which are
/// kept here, and the offset of a block give those in the block.
template <typename T>
class Footprint {
  using D = Lanes<T>;
  using V = hn::Vec<D>;

 public:
  struct Sample {
    V u, v, log2_alpha;  ///< As in `Splat`.
  };

  HWY_INLINE Footprint(const Splat<T>& splat, int tile_x, int tile_y)
      : uu(hn::Set(D(), splat.uu)),
        uv(hn::Set(D(), splat.uv)),
        vv(hn::Set(D(), splat.vv)),
        log2_opacity_(hn::Set(D(), splat.log2_opacity)) {
    const D d;
    HWY_ALIGN static constexpr T kCenters[2][kBlockPixels] = {
        {0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5},
        {0.5, 0.5, 0.5, 0.5, 1.5, 1.5, 1.5, 1.5, 2.5, 2.5, 2.5, 2.5, 3.5, 3.5, 3.5, 3.5}};
    const V x = hn::Set(d, T(tile_x * kTileSize) - splat.mean_x);
    const V y = hn::Set(d, T(tile_y * kTileSize) - splat.mean_y);
    for (std::size_t i = 0; i < kVectors; ++i) {
      const V dx = hn::Load(d, kCenters[0] + i * hn::Lanes(d)) + x;
      const V dy = hn::Load(d, kCenters[1] + i * hn::Lanes(d)) + y;
      first_u_[i] = hn::MulAdd(uv, dy, uu * dx);
      first_v_[i] = vv * dy;
    }
  }

  /// At the pixels of vector `i` of a block.
  HWY_INLINE Sample at(std::size_t block, std::size_t i) const {
    const V x = hn::Set(D(), kBlockOffsets<T>.x[block]);
    const V y = hn::Set(D(), kBlockOffsets<T>.y[block]);
    Sample s;
    s.u = hn::MulAdd(uu, x, hn::MulAdd(uv, y, first_u_[i]));
    s.v = hn::MulAdd(vv, y, first_v_[i]);
    s.log2_alpha = hn::NegMulAdd(s.u, s.u, hn::NegMulAdd(s.v, s.v, log2_opacity_));
    return s;
  }

  V uu, uv, vv;

 private:
  static constexpr std::size_t kVectors = kBlockPixels / hn::MaxLanes(D());
  V first_u_[kVectors], first_v_[kVectors], log2_opacity_;
};

/// Alpha from its logarithm; any value where that is far below every alpha_min.
template <class V>
HWY_INLINE V alpha_of(V log2_alpha) {
  const hn::DFromV<V> d;
  return hn::Min(exp2_nonpositive(d, log2_alpha), hn::Set(d, hn::TFromV<V>(kMaxAlpha)));
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
