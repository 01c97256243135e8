#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "blend.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "batch-inl.hpp"
#include "depth_sort.hpp"
#include "kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Adds w times kChannels features of the listed splats to the sums of a block.
template <std::size_t kChannels, typename T>
void blend_channels(const TileSplat<T>* splats, const std::uint16_t* list, std::uint32_t count,
                    const T* features, std::size_t dims, const T (*weights)[kBlockPixels],
                    T* sums) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d)) {
    V acc[kChannels];
    for (std::size_t c = 0; c < kChannels; ++c) acc[c] = hn::Load(d, sums + c * kBlockPixels + i);
    for (std::uint32_t k = 0; k < count; ++k) {
      const V w = hn::Load(d, weights[k] + i);
      const T* feature = features + std::size_t(splats[list[k]].gaussian) * dims;
      for (std::size_t c = 0; c < kChannels; ++c) {
        acc[c] = hn::MulAdd(w, hn::Set(d, feature[c]), acc[c]);
      }
    }
    for (std::size_t c = 0; c < kChannels; ++c) hn::Store(acc[c], d, sums + c * kBlockPixels + i);
  }
}

/// Adds w times the features of the listed splats to the sums of a block.
template <typename T>
void blend_features(const TileSplat<T>* splats, const std::uint16_t* list, std::uint32_t count,
                    const T* features, std::size_t dims, const T (*weights)[kBlockPixels],
                    T* sums) {
  std::size_t c = 0;
  for (; c + 8 <= dims; c += 8) {
    blend_channels<8>(splats, list, count, features + c, dims, weights, sums + c * kBlockPixels);
  }
  for (; c < dims; ++c) {
    blend_channels<1>(splats, list, count, features + c, dims, weights, sums + c * kBlockPixels);
  }
}

template <typename T>
void blend_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                const T* features, const WantedPixels& wanted) {
  static thread_local std::vector<TileEntry<T>> scratch;
  static thread_local Array<T> weight_memory;
  sort_by_depth(tile.entries, tile.count, scratch);

  const std::size_t dims = std::size_t(setup.feature_dims);
  const std::size_t stride = (5 + dims) * kBlockPixels;
  weight_memory.resize(dims ? kBatchSize * kBlockPixels : 0);
  const auto weights = reinterpret_cast<T(*)[kBlockPixels]>(weight_memory.data());
  HWY_ALIGN T transmittance[kBlocksPerTile * kBlockPixels];
  const std::uint64_t alive = start_transmittance(tile, setup, wanted, transmittance);
  std::fill(tile.sums, tile.sums + tile_sums_size(setup.feature_dims), T(0));

  const auto blend = [&](std::uint32_t, const TileSplat<T>* near, const std::uint16_t* list,
                         std::uint32_t count, std::size_t block) HWY_ATTR {
    T* sums = tile.sums + block * stride;
    T* t = transmittance + block * kBlockPixels;
    if (dims == 0) return blend_block<false>(near, list, count, setup, block, t, sums, weights);
    const bool goes_on = blend_block<true>(near, list, count, setup, block, t, sums, weights);
    blend_features(near, list, count, features, dims, weights, sums + 5 * kBlockPixels);
    return goes_on;
  };
  *tile.reached = for_each_block(tile, setup, splats, alive, blend);
}

auto blend_tile_float() { return &HWY_NAMESPACE::blend_tile<float>; }
auto blend_tile_double() { return &HWY_NAMESPACE::blend_tile<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(blend_tile_float);
HWY_EXPORT(blend_tile_double);

template <>
void blend_tile(const TileTask<float>& tile, const RenderSetup<float>& setup,
                const Splat<float>* splats, const float* features, const WantedPixels& wanted) {
  HWY_DYNAMIC_DISPATCH(blend_tile_float)()(tile, setup, splats, features, wanted);
}
template <>
void blend_tile(const TileTask<double>& tile, const RenderSetup<double>& setup,
                const Splat<double>* splats, const double* features, const WantedPixels& wanted) {
  HWY_DYNAMIC_DISPATCH(blend_tile_double)()(tile, setup, splats, features, wanted);
}

}  // namespace gslts::raster
#endif
