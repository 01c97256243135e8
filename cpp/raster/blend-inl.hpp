// Splats at the pixels of a tile, shared by the forward and the backward blending (3DGS, Kerbl et
// al. 2023, sec. 6). Included once per instruction set.

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

/// A splat relative to a tile: u and v are linear in the position in the tile, so their values at
/// its corner replace the mean.
template <typename T>
struct TileSplat {
  T corner_u, corner_v;
  T uu, uv, vv;  ///< These and the rest as in `Splat`.
  T log2_opacity;
  T color[3];
  T depth, depth_u, depth_v;
  std::uint32_t gaussian;
};

/// Computes u and v, as in `Splat`, at the corner of a tile.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void corner_uv(D d, V mean_x, V mean_y, V uu, V uv, V vv, int tile_x, int tile_y, V& u,
                          V& v) {
  using T = hn::TFromD<D>;
  const V x = hn::Set(d, T(tile_x * kTileSize)) - mean_x;
  const V y = hn::Set(d, T(tile_y * kTileSize)) - mean_y;
  u = hn::MulAdd(uv, y, uu * x);
  v = vv * y;
}

/// A splat whose numbers are repeated in all lanes; members as in `TileSplat`.
template <class D>
struct SplatInLanes {
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;
  V uu, uv, vv, log2_opacity;
  V red, green, blue;
  V depth, depth_u, depth_v;
  V corner_u, corner_v;

  HWY_INLINE SplatInLanes(D d, const TileSplat<T>& s)
      : SplatInLanes(d, s, hn::Set(d, s.corner_u), hn::Set(d, s.corner_v)) {}

  HWY_INLINE SplatInLanes(D d, const Splat<T>& s, int tile_x, int tile_y)
      : SplatInLanes(d, s, hn::Zero(d), hn::Zero(d)) {
    corner_uv(d, hn::Set(d, s.mean_x), hn::Set(d, s.mean_y), uu, uv, vv, tile_x, tile_y, corner_u,
              corner_v);
  }

 private:
  template <class S>
  HWY_INLINE SplatInLanes(D d, const S& s, V u, V v)
      : uu(hn::Set(d, s.uu)),
        uv(hn::Set(d, s.uv)),
        vv(hn::Set(d, s.vv)),
        log2_opacity(hn::Set(d, s.log2_opacity)),
        red(hn::Set(d, s.color[0])),
        green(hn::Set(d, s.color[1])),
        blue(hn::Set(d, s.color[2])),
        depth(hn::Set(d, s.depth)),
        depth_u(hn::Set(d, s.depth_u)),
        depth_v(hn::Set(d, s.depth_v)),
        corner_u(u),
        corner_v(v) {}
};

/// A splat at one vector of pixels: log2(alpha) = log2(o) - u^2 - v^2 (Kerbl et al. 2023, eq. 4).
template <class D>
struct Footprint {
  using V = hn::Vec<D>;
  V u, v, log2_alpha;

  HWY_INLINE Footprint(const SplatInLanes<D>& s, const PixelCenters<D>& at)
      : u(hn::MulAdd(s.uu, at.x, hn::MulAdd(s.uv, at.y, s.corner_u))),
        v(hn::MulAdd(s.vv, at.y, s.corner_v)),
        log2_alpha(hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, s.log2_opacity))) {}

  /// Depth of the splat at the pixels, m.
  HWY_INLINE V depth(const SplatInLanes<D>& s) const {
    return hn::MulAdd(s.depth_u, u, hn::MulAdd(s.depth_v, v, s.depth));
  }
};

/// Alpha at the pixels, at most kMaxAlpha; 0 where it is below alpha_min.
template <int kExpDegree, class D, class V = hn::Vec<D>>
HWY_INLINE V alpha_at(D d, const Footprint<D>& at, V log2_alpha_min) {
  const V alpha =
      hn::Min(exp2_nonpositive<kExpDegree>(d, at.log2_alpha), hn::Set(d, hn::TFromD<D>(kMaxAlpha)));
  return hn::IfThenElseZero(hn::Ge(at.log2_alpha, log2_alpha_min), alpha);
}

/// Sets the transmittance of the tile's wanted pixels to 1, and of all others to -1, which never
/// passes the test against transmittance_min.
/// @return  Bits of the blocks that hold a wanted pixel.
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
