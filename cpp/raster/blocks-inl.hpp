// Selection of the 4 x 4 blocks that splats touch, one splat a lane: the exact counterpart of the
// tile test of 3DGS (Kerbl et al. 2023, sec. 6). Included once per instruction set.

#if defined(GSLTS_RASTER_BLOCKS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_BLOCKS_INL_HPP
#undef GSLTS_RASTER_BLOCKS_INL_HPP
#else
#define GSLTS_RASTER_BLOCKS_INL_HPP
#endif

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "blend-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// The entries [begin, begin + count) of a tile, in depth order.
template <typename T>
struct Batch {
  std::uint32_t begin, count;
  TileSplat<T> splats[kBatchSize];
  /// Bit e % 64 of blocks[b][e / 64] is set if entry begin + e touches block b.
  std::uint64_t touching[kBlocksPerTile][kBatchWords];
};

/// Per row of blocks and entry of a batch, a bit for each block of the row.
using BlockRows = std::uint8_t[kBlocksPerRow][kBatchSize];

/// The ellipses alpha >= alpha_min, u^2 + v^2 <= power, of one splat a lane; relative to the tile.
template <class D>
struct Ellipses {
  hn::Vec<D> mean_x, mean_y;  ///< px
  hn::Vec<D> uu, uv, vv;      ///< 1/px
  hn::Vec<D> power;
};

/// Loads one entry a lane, from entry i of the batch on, and stores their splats in the batch.
template <class D, typename T>
HWY_INLINE Ellipses<D> load_entries(D d, const TileTask<T>& tile, const RenderSetup<T>& setup,
                                    const Splat<T>* splats, std::uint32_t i, Batch<T>& batch) {
  using V = hn::Vec<D>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t valid = std::min<std::size_t>(lanes, batch.count - i);
  const TileEntry<T>* entries = tile.entries + batch.begin;
  std::uint32_t slots[kBlockPixels];
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::uint32_t entry = i + std::uint32_t(std::min(lane, valid - 1));
    slots[lane] = entries[entry].slot;
    if (batch.begin + entry + kBlendPrefetch < tile.count) {
      __builtin_prefetch(splats + entries[entry + kBlendPrefetch].slot);
    }
  }
  V first[4], second[4];  // mean_x, mean_y, uu, uv; vv, log2_opacity and two colours
  load_columns(
      d, [&](std::size_t lane) { return &splats[slots[lane]].mean_x; }, first);
  load_columns(
      d, [&](std::size_t lane) { return &splats[slots[lane]].vv; }, second);
  V corner_u, corner_v;
  corner_uv(d, first[0], first[1], first[2], first[3], second[0], tile.x, tile.y, corner_u,
            corner_v);
  HWY_ALIGN T corners[2][kBlockPixels];
  hn::Store(corner_u, d, corners[0]);
  hn::Store(corner_v, d, corners[1]);
  for (std::size_t lane = 0; lane < valid; ++lane) {
    TileSplat<T>& out = batch.splats[i + lane];
    const Splat<T>& splat = splats[slots[lane]];
    out.corner_u = corners[0][lane];
    out.corner_v = corners[1][lane];
    std::memcpy(&out.uu, &splat.uu, offsetof(Splat<T>, gaussian) - offsetof(Splat<T>, uu));
    out.gaussian = splat.gaussian;
  }
  return {first[0] - hn::Set(d, T(tile.x * kTileSize)),
          first[1] - hn::Set(d, T(tile.y * kTileSize)),
          first[2],
          first[3],
          second[0],
          enlarge(d, second[1] - hn::Set(d, setup.log2_alpha_min))};
}

/// Extent of the ellipses in x over each row of blocks, in blocks instead of pixels: a block is
/// touched by what reaches its first pixel centre from the left or its last from the right.
template <class D>
class BlockExtent {
 public:
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;
  using U = hn::RebindToUnsigned<D>;

  HWY_INLINE BlockExtent(D d, const Ellipses<D>& e)
      : mean_y_(e.mean_y), vv_(e.vv), power_(e.power), top_(hn::Sqrt(e.power) / e.vv) {
    // Where the ellipse reaches farthest to the right; to the left it is at -rightmost.
    rightmost_ = hn::Neg(top_ * e.uv) / hn::Sqrt(hn::MulAdd(e.uv, e.uv, e.vv * e.vv));
    const V blocks_a_u = hn::Set(d, T(1) / kBlockSize) / e.uu;
    slope_ = hn::Neg(e.uv * blocks_a_u);
    margin_ = hn::Set(d, T(1) + kApproximateSqrtError<T>) * blocks_a_u;
    last_block_ =
        hn::MulAdd(e.mean_x, hn::Set(d, T(1) / kBlockSize), hn::Set(d, T(-0.5) / kBlockSize));
    first_block_ = last_block_ - hn::Set(d, T(kBlockSize - 1) / kBlockSize);
  }

  /// Bit b is set if the ellipse touches block b of the row.
  HWY_INLINE hn::Vec<U> touched_blocks(D d, int row) const {
    const V from = hn::Set(d, T(row * kBlockSize) + T(0.5)) - mean_y_;
    const V y0 = hn::Max(from, hn::Neg(top_));
    const V y1 = hn::Min(from + hn::Set(d, T(kBlockSize - 1)), top_);
    const V y_right = hn::Min(hn::Max(rightmost_, y0), y1);
    const V y_left = hn::Min(hn::Max(hn::Neg(rightmost_), y0), y1);
    const V right = hn::MulAdd(slope_, y_right, last_block_) + half_width(d, y_right);
    const V left = hn::MulAdd(slope_, y_left, first_block_) - half_width(d, y_left);
    const V first = hn::Max(hn::Ceil(left), hn::Zero(d));
    const V last = hn::Min(hn::Floor(right), hn::Set(d, T(kBlocksPerRow - 1)));
    return bits(hn::And(hn::Le(y0, y1), hn::Le(first, last)), first, last);
  }

 private:
  HWY_INLINE V half_width(D d, V y) const {
    const V v = vv_ * y;
    return approximate_sqrt(d, hn::NegMulAdd(v, v, power_)) * margin_;
  }

  /// Bits first..last, where `touched`.
  static HWY_INLINE hn::Vec<U> bits(hn::Mask<D> touched, V first, V last) {
    const U du;
    const hn::RebindToSigned<D> di;
    const auto one = hn::Set(du, 1);
    const auto first_bit = hn::BitCast(du, hn::ConvertTo(di, hn::IfThenElseZero(touched, first)));
    const auto last_bit = hn::BitCast(du, hn::ConvertTo(di, hn::IfThenElseZero(touched, last)));
    const auto all = hn::Sub(hn::Shl(hn::Add(one, one), last_bit), hn::Shl(one, first_bit));
    return hn::IfThenElseZero(hn::RebindMask(du, touched), all);
  }

  V mean_y_, vv_, power_, top_, rightmost_, slope_, margin_, first_block_, last_block_;
};

/// Transposes the bits of blocks by entry into bits of entries by block.
template <typename T>
void list_touching(BlockRows& rows, Batch<T>& batch) {
  const hn::CappedTag<std::uint8_t, 64> d8;
  const std::uint32_t words = (batch.count + 63) / 64;
  for (int row = 0; row < kBlocksPerRow; ++row) {
    std::fill(rows[row] + batch.count, rows[row] + 64 * words, std::uint8_t(0));
    for (std::uint32_t e = 0; e < 64 * words; e += std::uint32_t(hn::Lanes(d8))) {
      const auto bits = hn::Load(d8, rows[row] + e);
      for (int column = 0; column < kBlocksPerRow; ++column) {
        const auto touched = hn::TestBit(bits, hn::Set(d8, std::uint8_t(1 << column)));
        std::uint64_t* block = batch.touching[row * kBlocksPerRow + column];
        hn::StoreMaskBits(d8, touched, reinterpret_cast<std::uint8_t*>(block) + e / 8);
      }
    }
  }
}

/// Finds the blocks that hold a pixel centre inside the ellipse alpha >= alpha_min of each entry of
/// the batch.
template <typename T>
void find_blocks(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                 Batch<T>& batch) {
  const Lanes<T> d;
  const hn::RebindToUnsigned<Lanes<T>> du;
  const hn::Rebind<std::uint8_t, Lanes<T>> bytes;
  const std::size_t lanes = hn::Lanes(d);
  HWY_ALIGN BlockRows rows;
  for (std::uint32_t i = 0; i < batch.count; i += std::uint32_t(lanes)) {
    const BlockExtent<Lanes<T>> extent(d, load_entries(d, tile, setup, splats, i, batch));
    auto low = hn::Zero(du), high = hn::Zero(du);  // Bits of the upper and the lower four rows.
    for (int row = 0; row < kBlocksPerRow; ++row) {
      const auto touched = extent.touched_blocks(d, row);
      hn::StoreU(hn::TruncateTo(bytes, touched), bytes, rows[row] + i);
      if (row < kBlocksPerRow / 2) {
        low = hn::Or(low, hn::ShiftLeftSame(touched, kBlocksPerRow * row));
      } else {
        high = hn::Or(high, hn::ShiftLeftSame(touched, kBlocksPerRow * (row - kBlocksPerRow / 2)));
      }
    }
    HWY_ALIGN hn::TFromD<decltype(du)> lows[kBlockPixels] = {}, highs[kBlockPixels] = {};
    hn::Store(low, du, lows);
    hn::Store(high, du, highs);
    for (std::size_t lane = 0; lane < std::min<std::size_t>(lanes, batch.count - i); ++lane) {
      tile.blocks[batch.begin + i + lane] = std::uint64_t(lows[lane]) | std::uint64_t(highs[lane])
                                                                            << 32;
    }
  }
  list_touching(rows, batch);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
