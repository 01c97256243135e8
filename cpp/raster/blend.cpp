#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "blend.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <vector>

#include "blend-inl.hpp"
#include "depth_sort.hpp"
#include "kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

template <typename T>
void sort_entries(const TileTask<T>& tile, const Splat<T>* splats) {
  static thread_local std::vector<DepthItem<T>> items, scratch;
  static thread_local std::vector<TileEntry> unsorted;
  items.resize(tile.count);
  for (std::uint32_t i = 0; i < tile.count; ++i) {
    if (i + kPrefetchDistance < tile.count) {
      __builtin_prefetch(splats + tile.entries[i + kPrefetchDistance].slot);
    }
    items[i] = {depth_bits(splats[tile.entries[i].slot].depth), i};
  }
  sort_by_depth<T>(items, scratch);
  unsorted.assign(tile.entries, tile.entries + tile.count);
  for (std::uint32_t i = 0; i < tile.count; ++i) tile.entries[i] = unsorted[items[i].index];
}

/// Finds the blocks that hold a pixel centre inside the ellipse alpha >= alpha_min of each entry,
/// one entry a lane: per row of blocks, the ellipse's reach in x over the row's range of y.
template <typename T>
void find_blocks(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats) {
  static_assert(sizeof(Splat<T>) % sizeof(T) == 0);
  constexpr std::size_t kStride = sizeof(Splat<T>) / sizeof(T);
  const Lanes<T> d;
  const hn::RebindToSigned<Lanes<T>> di;
  const hn::RebindToUnsigned<Lanes<T>> du;
  using V = hn::Vec<Lanes<T>>;
  const std::size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d), last_pixel = hn::Set(d, T(kBlockSize - 1));
  const V half = hn::Set(d, T(0.5)), quarter = hn::Set(d, T(1) / kBlockSize);
  for (std::uint32_t i = 0; i < tile.count; i += std::uint32_t(lanes)) {
    const std::size_t valid = std::min<std::size_t>(lanes, tile.count - i);
    std::uint32_t slots[kBlockPixels];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      slots[lane] = tile.entries[i + std::min(lane, valid - 1)].slot;
    }
    // The columns are the first members of `Splat`, in their order.
    HWY_ALIGN T values[8][kBlockPixels];
    transpose_rows(&splats->mean_x, slots, lanes, kStride, values);
    transpose_rows(&splats->vv, slots, lanes, kStride, values + 4);
    const V mean_x = hn::Load(d, values[0]) - hn::Set(d, T(tile.x * kTileSize));
    const V mean_y = hn::Load(d, values[1]) - hn::Set(d, T(tile.y * kTileSize));
    const V uu = hn::Load(d, values[2]), uv = hn::Load(d, values[3]), vv = hn::Load(d, values[4]);
    // Slightly larger than exact, so that rounding never drops a pixel.
    const V power = hn::MulAdd(hn::Load(d, values[5]) - hn::Set(d, setup.log2_alpha_min),
                               hn::Set(d, T(1.001)), hn::Set(d, T(0.001)));
    const V inverse_uu = hn::Set(d, T(1)) / uu;
    const V slope = hn::Neg(uv * inverse_uu);
    const V top = hn::Sqrt(power) / vv;
    // Where the ellipse reaches farthest to the right; to the left it is at -rightmost.
    const V rightmost = hn::Neg(top * uv) / hn::Sqrt(hn::MulAdd(uv, uv, vv * vv));
    auto low = hn::Zero(du), high = hn::Zero(du);
    for (int row = 0; row < kBlocksPerRow; ++row) {
      const V from = hn::Set(d, T(row * kBlockSize)) + half - mean_y;
      const V y0 = hn::Max(from, hn::Neg(top)), y1 = hn::Min(from + last_pixel, top);
      const auto reach = [&](V y) HWY_ATTR {
        const V v = vv * y;
        return hn::Sqrt(hn::Max(hn::NegMulAdd(v, v, power), zero)) * inverse_uu;
      };
      const V y_right = hn::Min(hn::Max(rightmost, y0), y1);
      const V y_left = hn::Min(hn::Max(hn::Neg(rightmost), y0), y1);
      const V right = hn::MulAdd(slope, y_right, mean_x) + reach(y_right);
      const V left = hn::MulAdd(slope, y_left, mean_x) - reach(y_left);
      const V first = hn::Max(hn::Ceil((left - half - last_pixel) * quarter), zero);
      const V last = hn::Min(hn::Floor((right - half) * quarter), hn::Set(d, T(kBlocksPerRow - 1)));
      const auto touched = hn::And(hn::Le(y0, y1), hn::Le(first, last));
      // Bits first..last, where touched.
      const auto one = hn::Set(du, 1);
      const auto shift_of = [&](V v) HWY_ATTR {
        return hn::BitCast(du, hn::ConvertTo(di, hn::IfThenElseZero(touched, v)));
      };
      const auto bits =
          hn::Sub(hn::Shl(hn::Add(one, one), shift_of(last)), hn::Shl(one, shift_of(first)));
      const auto kept = hn::IfThenElseZero(hn::RebindMask(du, touched), bits);
      if (row < 4) {
        low = hn::Or(low, hn::ShiftLeftSame(kept, 8 * row));
      } else {
        high = hn::Or(high, hn::ShiftLeftSame(kept, 8 * (row - 4)));
      }
    }
    HWY_ALIGN hn::TFromD<decltype(du)> lows[kBlockPixels], highs[kBlockPixels];
    hn::Store(low, du, lows);
    hn::Store(high, du, highs);
    for (std::size_t lane = 0; lane < valid; ++lane) {
      tile.blocks[i + lane] = std::uint64_t(lows[lane]) | std::uint64_t(highs[lane]) << 32;
    }
  }
}

template <bool kHasFeatures, typename T>
void blend_entries(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                   const T* features, const WantedPixels& wanted) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t dims = kHasFeatures ? std::size_t(setup.feature_dims) : 0;
  const std::size_t stride = (5 + dims) * kBlockPixels;
  HWY_ALIGN T transmittance[kBlocksPerTile * kBlockPixels];
  std::uint64_t alive = start_transmittance(tile, setup, wanted, transmittance);
  std::fill(tile.sums, tile.sums + tile_sums_size(setup.feature_dims), T(0));

  const V threshold = hn::Set(d, setup.log2_alpha_min);
  const V transmittance_min = hn::Set(d, setup.transmittance_min);
  std::uint32_t entry = 0;
  for (; entry < tile.count && alive; ++entry) {
    std::uint64_t blocks = tile.blocks[entry] & alive;
    if (!blocks) continue;
    const Splat<T>& splat = splats[tile.entries[entry].slot];
    const Footprint<T> footprint(splat, tile.x, tile.y);
    const V red = hn::Set(d, splat.color[0]), green = hn::Set(d, splat.color[1]);
    const V blue = hn::Set(d, splat.color[2]), depth = hn::Set(d, splat.depth);
    const T* feature = features + splat.gaussian * dims;
    for (; blocks; blocks &= blocks - 1) {
      const std::size_t block = hwy::Num0BitsBelowLS1Bit_Nonzero64(blocks);
      bool any_alive = false;
      for (std::size_t i = 0; i < kBlockPixels; i += lanes) {
        T* sums = tile.sums + block * stride + i;
        T* t = transmittance + block * kBlockPixels + i;
        const auto at = footprint.at(block, i / lanes);
        const V before = hn::Load(d, t);
        const V weight =
            hn::IfThenElseZero(hn::Ge(at.log2_alpha, threshold), alpha_of(at.log2_alpha) * before);
        const V after = before - weight;
        hn::Store(after, d, t);
        // Multiplying on and masking by the result ends a pixel for good, as T only falls.
        const auto live = hn::Ge(after, transmittance_min);
        const V w = hn::IfThenElseZero(live, weight);
        const auto add = [&](int channel, V value) HWY_ATTR {
          T* sum = sums + channel * kBlockPixels;
          hn::Store(hn::MulAdd(w, value, hn::Load(d, sum)), d, sum);
        };
        add(0, red);
        add(1, green);
        add(2, blue);
        add(3, depth);
        hn::Store(hn::Load(d, sums + 4 * kBlockPixels) + w, d, sums + 4 * kBlockPixels);
        for (std::size_t k = 0; k < dims; ++k) add(5 + int(k), hn::Set(d, feature[k]));
        any_alive |= !hn::AllFalse(d, live);
      }
      if (!any_alive) alive &= ~(std::uint64_t{1} << block);
    }
  }
  *tile.reached = entry;
}

template <typename T>
void blend_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                const T* features, const WantedPixels& wanted) {
  sort_entries(tile, splats);
  find_blocks(tile, setup, splats);
  if (setup.feature_dims) {
    blend_entries<true>(tile, setup, splats, features, wanted);
  } else {
    blend_entries<false>(tile, setup, splats, features, wanted);
  }
}

void blend_tile_float(const TileTask<float>& tile, const RenderSetup<float>& setup,
                      const Splat<float>* splats, const float* features,
                      const WantedPixels& wanted) {
  HWY_NAMESPACE::blend_tile<float>(tile, setup, splats, features, wanted);
}
void blend_tile_double(const TileTask<double>& tile, const RenderSetup<double>& setup,
                       const Splat<double>* splats, const double* features,
                       const WantedPixels& wanted) {
  HWY_NAMESPACE::blend_tile<double>(tile, setup, splats, features, wanted);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(blend_tile_float);
HWY_EXPORT(blend_tile_double);

template <>
void blend_tile(const TileTask<float>& tile, const RenderSetup<float>& setup,
                const Splat<float>* splats, const float* features, const WantedPixels& wanted) {
  HWY_DYNAMIC_DISPATCH(blend_tile_float)(tile, setup, splats, features, wanted);
}
template <>
void blend_tile(const TileTask<double>& tile, const RenderSetup<double>& setup,
                const Splat<double>* splats, const double* features, const WantedPixels& wanted) {
  HWY_DYNAMIC_DISPATCH(blend_tile_double)(tile, setup, splats, features, wanted);
}

}  // namespace gslts::raster
#endif
