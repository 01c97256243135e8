// The entries of a tile, taken a batch at a time and blended a block at a time: what rendering and
// lifting share. Included once per instruction set.

#if defined(GSLTS_RASTER_BATCH_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_BATCH_INL_HPP
#undef GSLTS_RASTER_BATCH_INL_HPP
#else
#define GSLTS_RASTER_BATCH_INL_HPP
#endif

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "blend-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Entries of a tile that are blended before the next ones are looked at: what is kept of them
/// stays in the L1 cache, and a tile that has become opaque never looks at the rest.
constexpr std::uint32_t kBatchSize = 512;
constexpr std::uint32_t kBatchWords = kBatchSize / 64;

/// The entries [begin, begin + count) of a tile, in depth order.
template <typename T>
struct Batch {
  std::uint32_t begin, count;
  TileSplat<T> splats[kBatchSize];
  /// Bit e % 64 of blocks[b][e / 64] is set if entry begin + e touches block b.
  std::uint64_t touching[kBlocksPerTile][kBatchWords];
};

/// Finds the blocks that hold a pixel centre inside the ellipse alpha >= alpha_min of each entry,
/// one entry a lane: per row of blocks, the ellipse's reach in x over the row's range of y.
template <typename T>
void find_blocks(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                 Batch<T>& batch) {
  const Lanes<T> d;
  const hn::RebindToSigned<Lanes<T>> di;
  const hn::RebindToUnsigned<Lanes<T>> du;
  const hn::Rebind<std::uint8_t, Lanes<T>> bytes;
  using V = hn::Vec<Lanes<T>>;
  const std::size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d), last_pixel = hn::Set(d, T(kBlockSize - 1));
  const V quarter = hn::Set(d, T(1) / kBlockSize);
  const TileEntry<T>* entries = tile.entries + batch.begin;
  // Per row of blocks and entry, a bit for each block of the row.
  HWY_ALIGN std::uint8_t rows[kBlocksPerRow][kBatchSize];
  for (std::uint32_t i = 0; i < batch.count; i += std::uint32_t(lanes)) {
    const std::size_t valid = std::min<std::size_t>(lanes, batch.count - i);
    std::uint32_t slots[kBlockPixels];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::uint32_t entry = i + std::uint32_t(std::min(lane, valid - 1));
      slots[lane] = entries[entry].slot;
      if (batch.begin + entry + kPrefetchDistance < tile.count) {
        __builtin_prefetch(splats + entries[entry + kPrefetchDistance].slot);
      }
    }
    V shape[4], rest[4];
    load_columns(
        d, [&](std::size_t lane) { return &splats[slots[lane]].mean_x; }, shape);
    load_columns(
        d, [&](std::size_t lane) { return &splats[slots[lane]].vv; }, rest);
    V mean_x = shape[0], mean_y = shape[1], corner_u, corner_v;
    const V uu = shape[2], uv = shape[3], vv = rest[0], log2_opacity = rest[1];
    corner_uv(d, mean_x, mean_y, uu, uv, vv, tile.x, tile.y, corner_u, corner_v);
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

    mean_x = mean_x - hn::Set(d, T(tile.x * kTileSize));
    mean_y = mean_y - hn::Set(d, T(tile.y * kTileSize));
    // Slightly larger than exact, so that rounding never drops a pixel.
    const V power = hn::MulAdd(log2_opacity - hn::Set(d, setup.log2_alpha_min),
                               hn::Set(d, T(1.001)), hn::Set(d, T(0.001)));
    const V top = hn::Sqrt(power) / vv;
    // Where the ellipse reaches farthest to the right; to the left it is at -rightmost.
    const V rightmost = hn::Neg(top * uv) / hn::Sqrt(hn::MulAdd(uv, uv, vv * vv));
    // In x, blocks are counted instead of pixels: a block is touched by what reaches its first
    // pixel centre from the left or its last from the right.
    const V blocks_a_u = hn::Set(d, T(1) / kBlockSize) / uu;
    const V slope = hn::Neg(uv * blocks_a_u);
    const V margin = hn::Set(d, T(1) + kApproximateSqrtError<T>) * blocks_a_u;
    const V last_block = hn::MulAdd(mean_x, quarter, hn::Set(d, T(-0.5) / kBlockSize));
    const V first_block = last_block - hn::Set(d, T(kBlockSize - 1) / kBlockSize);
    auto low = hn::Zero(du), high = hn::Zero(du);
    for (int row = 0; row < kBlocksPerRow; ++row) {
      const V from = hn::Set(d, T(row * kBlockSize) + T(0.5)) - mean_y;
      const V y0 = hn::Max(from, hn::Neg(top)), y1 = hn::Min(from + last_pixel, top);
      const auto reach = [&](V y) HWY_ATTR {
        const V v = vv * y;
        return approximate_sqrt(d, hn::NegMulAdd(v, v, power)) * margin;
      };
      const V y_right = hn::Min(hn::Max(rightmost, y0), y1);
      const V y_left = hn::Min(hn::Max(hn::Neg(rightmost), y0), y1);
      const V right = hn::MulAdd(slope, y_right, last_block) + reach(y_right);
      const V left = hn::MulAdd(slope, y_left, first_block) - reach(y_left);
      const V first = hn::Max(hn::Ceil(left), zero);
      const V last = hn::Min(hn::Floor(right), hn::Set(d, T(kBlocksPerRow - 1)));
      const auto touched = hn::And(hn::Le(y0, y1), hn::Le(first, last));
      // Bits first..last, where touched.
      const auto one = hn::Set(du, 1);
      const auto shift_of = [&](V v) HWY_ATTR {
        return hn::BitCast(du, hn::ConvertTo(di, hn::IfThenElseZero(touched, v)));
      };
      const auto bits =
          hn::Sub(hn::Shl(hn::Add(one, one), shift_of(last)), hn::Shl(one, shift_of(first)));
      const auto kept = hn::IfThenElseZero(hn::RebindMask(du, touched), bits);
      hn::StoreU(hn::TruncateTo(bytes, kept), bytes, rows[row] + i);
      if (row < 4) {
        low = hn::Or(low, hn::ShiftLeftSame(kept, 8 * row));
      } else {
        high = hn::Or(high, hn::ShiftLeftSame(kept, 8 * (row - 4)));
      }
    }
    HWY_ALIGN hn::TFromD<decltype(du)> lows[kBlockPixels] = {}, highs[kBlockPixels] = {};
    hn::Store(low, du, lows);
    hn::Store(high, du, highs);
    for (std::size_t lane = 0; lane < valid; ++lane) {
      tile.blocks[batch.begin + i + lane] = std::uint64_t(lows[lane]) | std::uint64_t(highs[lane])
                                                                            << 32;
    }
  }

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

/// Lists the entries of the batch that touch a block. Returns their number.
template <typename T>
std::uint32_t list_entries(const Batch<T>& batch, std::size_t block, std::uint16_t* list) {
  std::uint32_t count = 0;
  for (std::uint32_t e = 0; e < batch.count; e += 64) {
    std::uint64_t bits = batch.touching[block][e / 64];
    const std::uint32_t n = std::uint32_t(hwy::PopCount(bits));
    // Eight at a time: mostly all, without a branch for each. What is too much is overwritten.
    for (std::uint32_t i = 0; i < n; i += 8) {
      for (std::uint32_t k = 0; k < 8; ++k) {
        const std::uint64_t nonzero = bits | std::uint64_t{1} << 63;
        list[count + i + k] = std::uint16_t(e + hwy::Num0BitsBelowLS1Bit_Nonzero64(nonzero));
        bits &= bits - 1;
      }
    }
    count += n;
  }
  return count;
}

/// Blends the listed splats into the sums of a block, all but its features. Returns whether a pixel
/// has not ended.
template <bool kStoreWeights, int kExpDegree, typename T>
bool blend_block_exp(const TileSplat<T>* splats, const std::uint16_t* list, std::uint32_t count,
                     const RenderSetup<T>& setup, std::size_t block, T* transmittance, T* sums,
                     T (*weights)[kBlockPixels]) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const V threshold = hn::Set(d, setup.log2_alpha_min);
  const V transmittance_min = hn::Set(d, setup.transmittance_min);
  bool any_alive = false;
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d)) {
    const PixelCenters<Lanes<T>> centers(d, block, i / hn::Lanes(d));
    const auto sum = [&](std::size_t channel) { return sums + channel * kBlockPixels + i; };
    V before = hn::Load(d, transmittance + i);
    V red = hn::Load(d, sum(0)), green = hn::Load(d, sum(1)), blue = hn::Load(d, sum(2));
    V depth = hn::Load(d, sum(3)), alpha = hn::Load(d, sum(4));
    bool alive = true;
    for (std::uint32_t k = 0; k < count; ++k) {
      const TileSplat<T>& s = splats[list[k]];
      const Footprint<Lanes<T>> at(hn::Set(d, s.corner_u), hn::Set(d, s.corner_v), hn::Set(d, s.uu),
                                   hn::Set(d, s.uv), hn::Set(d, s.vv), hn::Set(d, s.log2_opacity),
                                   centers);
      const V pixel_alpha =
          hn::IfThenElseZero(hn::Ge(at.log2_alpha, threshold), alpha_of<kExpDegree>(at.log2_alpha));
      const V after = hn::NegMulAdd(pixel_alpha, before, before);
      // Multiplying on and masking by the result ends a pixel for good, as T only falls.
      const auto live = hn::Ge(after, transmittance_min);
      const V w = hn::IfThenElseZero(live, pixel_alpha * before);
      red = hn::MulAdd(w, hn::Set(d, s.color[0]), red);
      green = hn::MulAdd(w, hn::Set(d, s.color[1]), green);
      blue = hn::MulAdd(w, hn::Set(d, s.color[2]), blue);
      const V z = hn::MulAdd(hn::Set(d, s.depth_u), at.u,
                             hn::MulAdd(hn::Set(d, s.depth_v), at.v, hn::Set(d, s.depth)));
      depth = hn::MulAdd(w, z, depth);
      alpha = alpha + w;
      before = after;
      if constexpr (kStoreWeights) hn::Store(w, d, weights[k] + i);
      if (HWY_UNLIKELY(hn::AllFalse(d, live))) {
        if constexpr (kStoreWeights) {
          while (++k < count) hn::Store(hn::Zero(d), d, weights[k] + i);
        }
        alive = false;
        break;
      }
    }
    hn::Store(before, d, transmittance + i);
    hn::Store(red, d, sum(0));
    hn::Store(green, d, sum(1));
    hn::Store(blue, d, sum(2));
    hn::Store(depth, d, sum(3));
    hn::Store(alpha, d, sum(4));
    any_alive |= alive;
  }
  return any_alive;
}

template <bool kStoreWeights, typename T>
bool blend_block(const TileSplat<T>* splats, const std::uint16_t* list, std::uint32_t count,
                 const RenderSetup<T>& setup, std::size_t block, T* transmittance, T* sums,
                 T (*weights)[kBlockPixels]) {
  const auto blend = setup.exp_degree == 3 ? &blend_block_exp<kStoreWeights, 3, T>
                                           : &blend_block_exp<kStoreWeights, 5, T>;
  return blend(splats, list, count, setup, block, transmittance, sums, weights);
}

/// Walks the tile, batch by batch and block by block, as long as `alive` blocks are left:
/// visit(begin, splats, list, count, block) gets the splats of the batch, which starts at entry
/// `begin`, and the list of those that touch the block, and tells whether a pixel of the block has
/// not ended. Returns the number of entries before that.
template <typename T, typename Visit>
std::uint32_t for_each_block(const TileTask<T>& tile, const RenderSetup<T>& setup,
                             const Splat<T>* splats, std::uint64_t alive, Visit visit) {
  Batch<T> batch;
  batch.begin = 0;
  for (; batch.begin < tile.count && alive; batch.begin += batch.count) {
    batch.count = std::min(kBatchSize, tile.count - batch.begin);
    find_blocks(tile, setup, splats, batch);
    for (std::uint64_t blocks = alive; blocks; blocks &= blocks - 1) {
      const std::size_t block = hwy::Num0BitsBelowLS1Bit_Nonzero64(blocks);
      std::uint16_t list[kBatchSize + 8];
      const std::uint32_t count = list_entries(batch, block, list);
      if (!visit(batch.begin, batch.splats, list, count, block))
        alive &= ~(std::uint64_t{1} << block);
    }
  }
  return batch.begin;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
