#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lift_tile.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <cstddef>

#include "batch-inl.hpp"
#include "kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Copies the pixels of a block, a padded row of channels each; those not wanted are 0.
template <typename T>
void load_block(const TileTask<T>& tile, const RenderSetup<T>& setup, const WantedPixels& wanted,
                const LiftChannels<T>& image, std::size_t block, T* out) {
  const int x0 = tile.x * kTileSize + int(block % kBlocksPerRow) * kBlockSize;
  const int y0 = tile.y * kTileSize + int(block / kBlocksPerRow) * kBlockSize;
  const std::size_t stride = image.stride();
  std::fill(out, out + kBlockPixels * stride, T(0));
  for (int p = 0; p < kBlockPixels; ++p) {
    const int x = x0 + p % kBlockSize, y = y0 + p / kBlockSize;
    if (x >= setup.width || y >= setup.height || !wanted.pixel(x, y)) continue;
    const T* pixel = image.data + (std::size_t(y) * setup.width + x) * image.dims + image.first;
    std::copy_n(pixel, image.count, out + std::size_t(p) * stride);
  }
}

/// Adds the sum over the pixels of w times the pixel's channels, kVectors vectors of them, to the
/// rows of kEntries entries.
template <std::size_t kEntries, std::size_t kVectors, typename T>
HWY_INLINE void lift_entries(const T (*weights)[kBlockPixels], const T* pixels, std::size_t stride,
                             T* const* rows, std::size_t first) {
  const Lanes<T> d;
  const std::size_t lanes = hn::Lanes(d);
  using V = hn::Vec<Lanes<T>>;
  V sums[kEntries][kVectors];
  for (std::size_t e = 0; e < kEntries; ++e) {
    for (std::size_t v = 0; v < kVectors; ++v) {
      sums[e][v] = hn::LoadU(d, rows[e] + first + v * lanes);
    }
  }
  for (std::size_t p = 0; p < kBlockPixels; ++p) {
    V channels[kVectors];
    for (std::size_t v = 0; v < kVectors; ++v) {
      channels[v] = hn::LoadU(d, pixels + p * stride + first + v * lanes);
    }
    for (std::size_t e = 0; e < kEntries; ++e) {
      const V w = hn::Set(d, weights[e][p]);
      for (std::size_t v = 0; v < kVectors; ++v) {
        sums[e][v] = hn::MulAdd(w, channels[v], sums[e][v]);
      }
    }
  }
  for (std::size_t e = 0; e < kEntries; ++e) {
    for (std::size_t v = 0; v < kVectors; ++v) {
      hn::StoreU(sums[e][v], d, rows[e] + first + v * lanes);
    }
  }
}

template <std::size_t kEntries, typename T>
HWY_INLINE void lift_channels(const T (*weights)[kBlockPixels], const T* pixels, std::size_t stride,
                              T* const* rows) {
  const std::size_t lanes = hn::Lanes(Lanes<T>());
  std::size_t first = 0;
  for (; first + 2 * lanes <= stride; first += 2 * lanes) {
    lift_entries<kEntries, 2>(weights, pixels, stride, rows, first);
  }
  for (; first < stride; first += lanes) {
    lift_entries<kEntries, 1>(weights, pixels, stride, rows, first);
  }
}

/// Adds the pixels of one block, weighted, to the rows of the listed entries.
template <typename T>
void lift_block(const TileEntry<T>* entries, const std::uint16_t* list, std::uint32_t count,
                const T (*weights)[kBlockPixels], const T* pixels, std::size_t stride,
                const EntryLifts<T>& out) {
  constexpr std::size_t kGroup = 4;  // Entries whose sums fit the registers.
  const auto row_of = [&](std::uint32_t k) HWY_ATTR {
    const std::size_t index = entries[list[k]].gradient;
    out.weights[index] += sum_of_pixels(weights[k]);
    return out.features + index * stride;
  };
  std::uint32_t k = 0;
  for (; k + kGroup <= count; k += kGroup) {
    T* rows[kGroup];
    for (std::uint32_t e = 0; e < kGroup; ++e) rows[e] = row_of(k + e);
    lift_channels<kGroup>(weights + k, pixels, stride, rows);
  }
  for (; k < count; ++k) {
    T* row = row_of(k);
    lift_channels<1>(weights + k, pixels, stride, &row);
  }
}

/// Sets the sums of all entries of a tile to 0.
template <typename T>
void clear_entries(const TileTask<T>& tile, std::size_t stride, const EntryLifts<T>& out) {
  for (std::uint32_t e = 0; e < tile.count; ++e) {
    const std::size_t index = tile.entries[e].gradient;
    std::fill_n(out.features + index * stride, stride, T(0));
    out.weights[index] = T(0);
  }
}

template <typename T>
bool lift_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
               const WantedPixels& wanted, const LiftChannels<T>& image, const EntryLifts<T>& out) {
  static thread_local Array<T> weight_memory, pixel_memory;
  const std::size_t stride = image.stride();
  weight_memory.resize(kBatchSize * kBlockPixels);
  pixel_memory.resize(kBlockPixels * stride);
  const auto weights = reinterpret_cast<T(*)[kBlockPixels]>(weight_memory.data());
  T* pixels = pixel_memory.data();
  clear_entries(tile, stride, out);
  HWY_ALIGN T transmittance[kBlocksPerTile * kBlockPixels];
  const std::uint64_t alive = start_transmittance(tile, setup, wanted, transmittance);
  // All wanted pixels are checked, also where there is no Gaussian to lift to.
  for (std::uint64_t blocks = alive; blocks; blocks &= blocks - 1) {
    const std::size_t block = hwy::Num0BitsBelowLS1Bit_Nonzero64(blocks);
    load_block(tile, setup, wanted, image, block, pixels);
    if (!all_finite(pixels, kBlockPixels * stride)) return false;
  }
  const auto lift = [&](std::uint32_t begin, const TileSplat<T>* near, const std::uint16_t* list,
                        std::uint32_t count, std::size_t block) HWY_ATTR {
    load_block(tile, setup, wanted, image, block, pixels);
    HWY_ALIGN T unused_sums[5 * kBlockPixels] = {};
    const bool goes_on =
        blend_block<true>(near, list, count, setup, block, transmittance + block * kBlockPixels,
                          unused_sums, weights);
    lift_block<T>(tile.entries + begin, list, count, weights, pixels, stride, out);
    return goes_on;
  };
  for_each_block(tile, setup, splats, alive, lift);
  return true;
}

auto lift_tile_float() { return &HWY_NAMESPACE::lift_tile<float>; }
auto lift_tile_double() { return &HWY_NAMESPACE::lift_tile<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(lift_tile_float);
HWY_EXPORT(lift_tile_double);

template <>
bool lift_tile(const TileTask<float>& tile, const RenderSetup<float>& setup,
               const Splat<float>* splats, const WantedPixels& wanted,
               const LiftChannels<float>& image, const EntryLifts<float>& out) {
  return HWY_DYNAMIC_DISPATCH(lift_tile_float)()(tile, setup, splats, wanted, image, out);
}
template <>
bool lift_tile(const TileTask<double>& tile, const RenderSetup<double>& setup,
               const Splat<double>* splats, const WantedPixels& wanted,
               const LiftChannels<double>& image, const EntryLifts<double>& out) {
  return HWY_DYNAMIC_DISPATCH(lift_tile_double)()(tile, setup, splats, wanted, image, out);
}

}  // namespace gslts::raster
#endif
