#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "binning.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "setup.hpp"
#include "splat.hpp"

// The SIMD kernels, in the order in which a render and its backward pass call them. Each is
// compiled for several instruction sets, and the best of the machine is called.

namespace gslts::raster {

/// Projects the Gaussians of chunk splats.chunks[index] of the map into the chunk's slots.
/// @return  false if a number among them is not finite.
template <typename T>
bool project_chunk(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                   const WantedPixels& wanted, std::size_t index, Splats<T>& splats);

/// Number of the sums of a tile: per block, kBlockPixels values of each of red, green, blue,
/// sum w z, sum w, features; before the background and the division of the depth.
constexpr std::size_t tile_sums_size(int feature_dims) {
  return std::size_t(kBlocksPerTile) * kBlockPixels * std::size_t(5 + feature_dims);
}

/// A tile with its list of splats.
template <typename T>
struct TileTask {
  int x, y;                ///< In tiles.
  std::uint64_t wanted;    ///< Wanted blocks.
  TileEntry<T>* entries;   ///< [count]
  std::uint64_t* blocks;   ///< [count] blocks that each entry touches
  std::uint32_t count;     ///< Entries.
  std::uint32_t* reached;  ///< Number of entries before every pixel had ended.
  T* sums;                 ///< [tile_sums_size]
};

/// Sorts the tile's entries by depth, finds the blocks that each touches, and blends them into
/// sums.
template <typename T>
void blend_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
                const T* features, const WantedPixels& wanted);

/// Turns the sums of a tile into its part of the images; a tile without entries has no sums.
template <typename T>
void write_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Images<T>& images);

/// Sums over the pixels of one tile from which the backward pass of a splat starts, with G =
/// dL/dlog(alpha), the blend weight w and the depth z at the pixel.
enum EntrySum {
  kSum,     ///< G
  kSumU,    ///< G u
  kSumV,    ///< G v
  kSumUU,   ///< G u^2
  kSumUV,   ///< G u v
  kSumVV,   ///< G v^2
  kSumRed,  ///< w dL/dred, and green and blue
  kSumGreen,
  kSumBlue,
  kSumDepth,   ///< dL/dz
  kSumDepthU,  ///< u dL/dz
  kSumDepthV,  ///< v dL/dz
  kSumsPerEntry
};
/// |dL/dmean2d| x and y, greatest w, number of pixels.
constexpr int kStatisticsPerEntry = 4;

template <typename T>
struct EntryGradients {
  T* sums;        ///< [entries, kSumsPerEntry]
  T* features;    ///< [entries, D], or null if the loss ignores the features
  T* statistics;  ///< [entries, kStatisticsPerEntry] or null
};

/// @return  false if a number among the image gradients of the tile is not finite.
template <typename T>
bool blend_tile_backward(const TileTask<T>& tile, const RenderSetup<T>& setup,
                         const Splat<T>* splats, const T* features, const WantedPixels& wanted,
                         const ImageGradients<T>& image_gradients,
                         const EntryGradients<T>& entry_gradients);

/// Some channels of a feature image.
template <typename T>
struct LiftChannels {
  const T* data;             ///< [H,W,dims]
  std::size_t dims;          ///< Number of channels of the image.
  std::size_t first, count;  ///< Channels [first, first + count).

  /// Length of a row of sums: whole vectors.
  std::size_t stride() const { return (count + kBlockPixels - 1) / kBlockPixels * kBlockPixels; }
};

/// Sums over the pixels of one tile, by entry.
template <typename T>
struct EntryLifts {
  T* features;  ///< [entries, stride] sum w S
  T* weights;   ///< [entries] sum w
};

/// Lifts the pixels of a tile whose entries have been sorted by `blend_tile`.
/// @return  false if a wanted number among the channels is not finite.
template <typename T>
bool lift_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const Splat<T>* splats,
               const WantedPixels& wanted, const LiftChannels<T>& image, const EntryLifts<T>& out);

/// Computes the gradients of the `count` splats of a chunk from their sums, into rows first_row...
/// of `gradients`. Adds the chunk's part of the gradient of the pose to `twist`.
template <typename T>
void project_chunk_backward(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                            const Splat<T>* splats, std::size_t count, const T* sums,
                            std::size_t first_row, Gradients<T>& gradients,
                            std::array<double, 6>& twist);

}  // namespace gslts::raster
