#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "binning.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "kernels.hpp"
#include "setup.hpp"
#include "splat.hpp"

namespace gslts::raster {

/// Working memory of the tiles of one band, which the backward pass reads.
template <typename T>
struct BandMemory {
  Array<std::uint64_t> blocks;         ///< [entries]
  std::vector<std::uint32_t> reached;  ///< [tiles]
  std::vector<std::size_t> sums_of;    ///< [tiles] offset into sums
  Array<T> sums;                       ///< Sums of the tiles that have entries.
};

/// Working memory of one rendering, which its backward pass and lifting read.
template <typename T>
struct RenderState {
  std::optional<RenderSetup<T>> setup;  ///< Setup of the last forward.
  std::size_t map_size = 0;
  WantedPixels wanted;
  Splats<T> splats;
  std::vector<Band<T>> bands;
  BandMemory<T> memory;  ///< Memory of the last band.
  Array<T> entry_sums, entry_features, entry_statistics, splat_sums;

  Images<T> render(const GaussianView<T>& gaussians);
  /// Blends the splats of a band.
  /// @param images  Receives its pixels, unless null.
  void blend_band(const GaussianView<T>& gaussians, Band<T>& band, Images<T>* images);
  TileTask<T> tile_task(Band<T>& band, std::size_t tile);
  /// Returns the first row of each chunk in arrays of the visible Gaussians, and their number.
  std::vector<std::size_t> first_rows() const;
  /// @throws std::logic_error  naming the caller, if there was no forward.
  /// @throws std::invalid_argument  if the sizes are not those of the forward.
  void require_forward_of(const GaussianView<T>& gaussians, const char* function) const;

  /// Calls visit(splat of the chunk, index) for every gradient that the splats of a chunk have in
  /// the wanted tiles of a band: splat by splat, tile by tile.
  template <typename Visit>
  void for_each_gradient(const Band<T>& band, std::size_t chunk, Visit visit) const {
    const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
    std::size_t first = band.first_gradients[chunk];
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      const TileRect rect = clip(keys[i].rect, band);
      for_each_tile(rect, band, setup->tiles_x, wanted,
                    [&](int, std::uint32_t rank) { visit(i, first + rank); });
      first += area(rect);
    }
  }

 private:
  void project(const GaussianView<T>& gaussians);
};

/// @throws std::invalid_argument  naming the first number of an image [H,W,channels] that is not
///   finite, if there is one among the wanted pixels. A null image is fine.
template <typename T>
void require_finite_image(const char* name, const T* data, int channels,
                          const RenderSetup<T>& setup, const WantedPixels& wanted);

}  // namespace gslts::raster
