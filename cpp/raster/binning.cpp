#include "binning.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

constexpr std::size_t kNowhereTiles = 3;

/// Entries are numbered in 32 bits; the rest is room for those of `nowhere`.
constexpr std::uint64_t kMaxBandEntries = std::numeric_limits<std::uint32_t>::max() - (1u << 20);

/// Most splats touch at most 2 x 2 tiles, in no predictable pattern: this visits those four without
/// a branch, the untouched ones as one of the three tiles from `nowhere` on, with an increment of
/// 0. Three, because writing one of them would have to wait for the write before.
template <typename Visit>
void for_each_tile_of_four(const TileRect& rect, int tiles_x, int nowhere, Visit visit) {
  const int tile = rect.y0 * tiles_x + rect.x0;
  const int wide = rect.x1 - rect.x0 - 1, high = rect.y1 - rect.y0 - 1;
  visit(tile, 0, 1);
  visit(wide ? tile + 1 : nowhere, 1, wide);
  visit(high ? tile + tiles_x : nowhere + 1, 1 + wide, high);
  visit(wide & high ? tile + tiles_x + 1 : nowhere + 2, 3, wide & high);
}

bool within_four(const TileRect& rect) { return rect.x1 - rect.x0 <= 2 && rect.y1 - rect.y0 <= 2; }

/// Chunks [begin, end) of one of `groups` equal shares.
std::pair<std::size_t, std::size_t> share(std::size_t chunks, std::size_t group,
                                          std::size_t groups) {
  return {chunks * group / groups, chunks * (group + 1) / groups};
}

}  // namespace

template <typename T>
std::vector<Band<T>> plan_bands(const Splats<T>& splats, const RenderSetup<T>& setup) {
  std::uint64_t visible = 0, total = 0;
  for (std::size_t chunk = 0; chunk < splats.counts.size(); ++chunk) {
    const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
    visible += splats.counts[chunk];
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      const TileRect& rect = keys[i].rect;
      total += std::uint64_t(rect.x1 - rect.x0) * (rect.y1 - rect.y0);
    }
  }
  const std::uint64_t budget = std::max<std::uint64_t>(kMinBandEntries, 4 * visible);
  if (total <= budget) {
    Band<T> whole;
    whole.last_row = setup.tiles_y;
    return {whole};
  }
  std::vector<std::uint64_t> row_entries(setup.tiles_y, 0);
  for (std::size_t chunk = 0; chunk < splats.counts.size(); ++chunk) {
    const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      const TileRect& rect = keys[i].rect;
      for (int y = rect.y0; y < rect.y1; ++y) row_entries[y] += rect.x1 - rect.x0;
    }
  }
  std::vector<Band<T>> bands;
  std::uint64_t entries = 0;
  for (int row = 0; row < setup.tiles_y; ++row) {
    if (bands.empty() || entries + row_entries[row] > budget) {
      bands.emplace_back();
      bands.back().first_row = row;
      entries = 0;
    }
    bands.back().last_row = row + 1;
    entries += row_entries[row];
    if (entries > kMaxBandEntries) {
      throw std::runtime_error("Rasterizer::forward: the Gaussians in view touch " +
                               std::to_string(entries) + " tiles of one row, at most " +
                               std::to_string(kMaxBandEntries) + " can be held");
    }
  }
  return bands;
}

template <typename T>
void bin_splats(const Splats<T>& splats, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Band<T>& band) {
  const std::size_t chunks = splats.counts.size();
  const std::size_t tiles = std::size_t(band.last_row - band.first_row) * setup.tiles_x;
  const std::size_t groups = std::max<std::size_t>(1, std::min<std::size_t>(setup.threads, chunks));
  const bool simple = wanted.all() && band.first_row == 0 && band.last_row == setup.tiles_y;
  const int nowhere = int(tiles);
  // A counting sort. The lists come out in slot order whatever the number of groups.
  std::vector<std::vector<std::uint32_t>> cursors(groups);
  band.first_gradients.assign(chunks + 1, 0);
  parallel::parallel_for(groups, setup.threads, [&](std::size_t group) {
    std::vector<std::uint32_t>& counts = cursors[group];
    counts.assign(tiles + kNowhereTiles, 0);
    const auto [begin, end] = share(chunks, group, groups);
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
      std::uint32_t entries = 0;
      for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
        const TileRect& rect = keys[i].rect;
        if (simple && within_four(rect)) {
          for_each_tile_of_four(rect, setup.tiles_x, nowhere, [&](int tile, int, int one) {
            counts[tile] += one;
            entries += one;
          });
          continue;
        }
        for_each_tile(rect, band, setup.tiles_x, wanted, [&](int tile) {
          ++counts[tile];
          ++entries;
        });
      }
      band.first_gradients[chunk + 1] = entries;
    }
  });
  std::partial_sum(band.first_gradients.begin(), band.first_gradients.end(),
                   band.first_gradients.begin());
  band.offsets.resize(tiles + 1);
  std::uint32_t offset = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    band.offsets[tile] = offset;
    for (std::vector<std::uint32_t>& cursor : cursors) {
      const std::uint32_t count = cursor[tile];
      cursor[tile] = offset;
      offset += count;
    }
  }
  band.offsets[tiles] = offset;
  // Each group has entries of its own for `nowhere`.
  band.entries.resize(offset + groups * kNowhereTiles);
  for (std::size_t group = 0; group < groups; ++group) {
    std::iota(cursors[group].begin() + tiles, cursors[group].end(),
              std::uint32_t(offset + group * kNowhereTiles));
  }
  parallel::parallel_for(groups, setup.threads, [&](std::size_t group) {
    std::vector<std::uint32_t>& cursor = cursors[group];
    const auto [begin, end] = share(chunks, group, groups);
    std::uint32_t gradient = band.first_gradients[begin];
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const std::uint32_t first_slot = std::uint32_t(chunk * kChunkSize);
      for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
        const TileRect& rect = splats.keys[first_slot + i].rect;
        const DepthBits<T> depth = splats.keys[first_slot + i].depth;
        if (simple && within_four(rect)) {
          const std::uint32_t first = gradient;
          for_each_tile_of_four(rect, setup.tiles_x, nowhere, [&](int tile, int rank, int one) {
            band.entries[cursor[tile]] = {first_slot + i, first + rank, depth};
            cursor[tile] += one;
            gradient += one;
          });
          continue;
        }
        for_each_tile(rect, band, setup.tiles_x, wanted, [&](int tile) {
          band.entries[cursor[tile]++] = {first_slot + i, gradient++, depth};
        });
      }
    }
  });
  band.entries.resize(offset);
}

template std::vector<Band<float>> plan_bands(const Splats<float>&, const RenderSetup<float>&);
template std::vector<Band<double>> plan_bands(const Splats<double>&, const RenderSetup<double>&);
template void bin_splats(const Splats<float>&, const RenderSetup<float>&, const WantedPixels&,
                         Band<float>&);
template void bin_splats(const Splats<double>&, const RenderSetup<double>&, const WantedPixels&,
                         Band<double>&);

}  // namespace gslts::raster
