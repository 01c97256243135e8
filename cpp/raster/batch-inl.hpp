// Front-to-back blending of the entries of a tile, a batch at a time and a block at a time, shared
// by rendering and lifting (3DGS, Kerbl et al. 2023, eq. 3). Included once per instruction set.

#if defined(GSLTS_RASTER_BATCH_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_BATCH_INL_HPP
#undef GSLTS_RASTER_BATCH_INL_HPP
#else
#define GSLTS_RASTER_BATCH_INL_HPP
#endif

#include <algorithm>
#include <cstddef>

#include "blocks-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Lists the entries of the batch that touch a block.
/// @param list  Receives them; the eight numbers behind are overwritten.
/// @return  Their number.
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

/// The sums of one vector of pixels, kBlockPixels numbers apart in memory.
template <class D>
struct BlendedPixels {
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;
  V red, green, blue, depth, alpha;

  HWY_INLINE BlendedPixels(D d, const T* sums)
      : red(hn::Load(d, sums)),
        green(hn::Load(d, sums + kBlockPixels)),
        blue(hn::Load(d, sums + 2 * kBlockPixels)),
        depth(hn::Load(d, sums + 3 * kBlockPixels)),
        alpha(hn::Load(d, sums + 4 * kBlockPixels)) {}

  HWY_INLINE void add(V w, const SplatInLanes<D>& splat, const Footprint<D>& at) {
    red = hn::MulAdd(w, splat.red, red);
    green = hn::MulAdd(w, splat.green, green);
    blue = hn::MulAdd(w, splat.blue, blue);
    depth = hn::MulAdd(w, at.depth(splat), depth);
    alpha = alpha + w;
  }

  HWY_INLINE void store(D d, T* sums) const {
    hn::Store(red, d, sums);
    hn::Store(green, d, sums + kBlockPixels);
    hn::Store(blue, d, sums + 2 * kBlockPixels);
    hn::Store(depth, d, sums + 3 * kBlockPixels);
    hn::Store(alpha, d, sums + 4 * kBlockPixels);
  }
};

/// Blends the listed splats into the sums of a block, all but its features: C = sum_i w_i c_i with
/// w_i = alpha_i T_i and T_{i+1} = (1 - alpha_i) T_i (Kerbl et al. 2023, eq. 3).
/// @return  Whether a pixel has not ended.
template <bool kStoreWeights, int kExpDegree, typename T>
bool blend_block_exp(const TileSplat<T>* splats, const std::uint16_t* list, std::uint32_t count,
                     const RenderSetup<T>& setup, std::size_t block, T* transmittance, T* sums,
                     T (*weights)[kBlockPixels]) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const V log2_alpha_min = hn::Set(d, setup.log2_alpha_min);
  const V transmittance_min = hn::Set(d, setup.transmittance_min);
  bool any_alive = false;
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d)) {
    const PixelCenters<Lanes<T>> centers(d, block, i / hn::Lanes(d));
    BlendedPixels<Lanes<T>> pixels(d, sums + i);
    V before = hn::Load(d, transmittance + i);
    bool alive = true;
    for (std::uint32_t k = 0; k < count; ++k) {
      const SplatInLanes<Lanes<T>> splat(d, splats[list[k]]);
      const Footprint<Lanes<T>> at(splat, centers);
      const V alpha = alpha_at<kExpDegree>(d, at, log2_alpha_min);
      const V after = hn::NegMulAdd(alpha, before, before);
      // Multiplying on and masking by the result ends a pixel for good, as T only falls.
      const auto live = hn::Ge(after, transmittance_min);
      const V w = hn::IfThenElseZero(live, alpha * before);
      pixels.add(w, splat, at);
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
    pixels.store(d, sums + i);
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

/// Visits the blocks of a tile, batch by batch, until no block is alive.
/// @param alive  Bits of the blocks to visit.
/// @param visit  visit(begin, splats, list, count, block) gets the splats of the batch, which
/// starts
///   at entry `begin`, and the list of those that touch the block; it returns whether a pixel of
///   the block has not ended.
/// @return  Number of entries before the last pixel had ended.
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
      if (!visit(batch.begin, batch.splats, list, count, block)) {
        alive &= ~(std::uint64_t{1} << block);
      }
    }
  }
  return batch.begin;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
