#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "setup.hpp"
#include "splat.hpp"

namespace gslts::raster {

/// A splat in the list of a tile. Its gradient in that tile has the index `gradient`.
template <typename T>
struct TileEntry {
  std::uint32_t slot;
  std::uint32_t gradient;
  DepthBits<T> depth;
};

/// Tile rows [first_row, last_row) and, once binned, the lists of their tiles.
template <typename T>
struct Band {
  int first_row = 0, last_row = 0;
  std::vector<std::uint32_t> offsets;  ///< [tiles + 1] first entry of each tile's list
  Array<TileEntry<T>> entries;         ///< By tile, then by slot.
  /// [chunks + 1] index of the first gradient of each chunk. Splats follow in the order of their
  /// slots, and the tiles of one splat's rectangle in the band row by row, unwanted ones included.
  std::vector<std::uint32_t> first_gradients;
};

/// Clips a rectangle to the band; one outside gets no height.
template <typename T>
TileRect clip(TileRect rect, const Band<T>& band) {
  rect.y0 = std::uint16_t(std::clamp<int>(rect.y0, band.first_row, band.last_row));
  rect.y1 = std::uint16_t(std::clamp<int>(rect.y1, rect.y0, band.last_row));
  return rect;
}

constexpr std::uint32_t area(const TileRect& rect) {
  return std::uint32_t(rect.x1 - rect.x0) * std::uint32_t(rect.y1 - rect.y0);
}

/// Calls visit(tile of the band, rank in the rectangle) for every wanted tile of a clipped
/// rectangle.
template <typename T, typename Visit>
void for_each_tile(const TileRect& rect, const Band<T>& band, int tiles_x,
                   const WantedPixels& wanted, Visit visit) {
  std::uint32_t rank = 0;
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = rect.x0; x < rect.x1; ++x, ++rank) {
      if (wanted.all() || wanted.blocks(y * tiles_x + x)) {
        visit((y - band.first_row) * tiles_x + x, rank);
      }
    }
  }
}

/// Cuts the image into bands of tile rows with a bounded number of entries each; one as a rule.
template <typename T>
std::vector<Band<T>> plan_bands(const Splats<T>& splats, const RenderSetup<T>& setup);

/// Sorts the splats into the lists of the band's tiles.
template <typename T>
void bin_splats(const Splats<T>& splats, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Band<T>& band);

}  // namespace gslts::raster
