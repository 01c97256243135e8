#include "binning.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

/// Entries are numbered in 32 bits; the rest is room for those of `nowhere`.
constexpr std::uint64_t kMaxBandEntries = std::numeric_limits<std::uint32_t>::max() - (1u << 20);

/// Entries between the one written to a list and the one whose place is fetched: the lists grow in
/// no order, and every new cache line would otherwise be waited for.
constexpr std::uint32_t kPrefetchDistance = 8;

constexpr std::size_t kNowhereTiles = 3;

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

/// The number of rectangles over each tile, from their corners alone.
class TileCounts {
 public:
  TileCounts(int rows, int columns)
      : rows_(rows), columns_(columns), corners_(std::size_t(rows + 1) * (columns + 1), 0) {}

  void add(const TileRect& rect, int first_row) {
    std::int32_t* top = corners_.data() + std::size_t(rect.y0 - first_row) * (columns_ + 1);
    std::int32_t* bottom = corners_.data() + std::size_t(rect.y1 - first_row) * (columns_ + 1);
    ++top[rect.x0];
    --top[rect.x1];
    --bottom[rect.x0];
    ++bottom[rect.x1];
  }

  std::vector<std::uint32_t> counts() const {
    std::vector<std::uint32_t> counts, above(columns_, 0);
    counts.reserve(std::size_t(rows_) * columns_);
    for (int y = 0; y < rows_; ++y) {
      std::int32_t sum = 0;
      for (int x = 0; x < columns_; ++x) {
        sum += corners_[std::size_t(y) * (columns_ + 1) + x];
        above[x] += sum;
        counts.push_back(above[x]);
      }
    }
    return counts;
  }

 private:
  int rows_, columns_;
  std::vector<std::int32_t> corners_;  ///< [rows + 1, columns + 1]
};

/// Chunks [begin, end) of one of `groups` equal shares.
std::pair<std::size_t, std::size_t> share(std::size_t chunks, std::size_t group,
                                          std::size_t groups) {
  return {chunks * group / groups, chunks * (group + 1) / groups};
}

}  // namespace

template <typename T>
std::vector<Band<T>> plan_bands(const Splats<T>& splats, const RenderSetup<T>& setup) {
  const auto visible =
      std::accumulate(splats.counts.begin(), splats.counts.end(), std::uint64_t{0});
  const auto total = std::accumulate(splats.areas.begin(), splats.areas.end(), std::uint64_t{0});
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
    TileCounts counts(band.last_row - band.first_row, setup.tiles_x);
    const auto [begin, end] = share(chunks, group, groups);
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
      std::uint32_t places = 0;
      for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
        const TileRect rect = clip(keys[i].rect, band);
        counts.add(rect, band.first_row);
        places += area(rect);
      }
      band.first_gradients[chunk + 1] = places;
    }
    cursors[group] = counts.counts();
    for (std::size_t tile = 0; tile < tiles && !wanted.all(); ++tile) {
      const int first_tile = band.first_row * setup.tiles_x;
      if (!wanted.blocks(first_tile + int(tile))) cursors[group][tile] = 0;
    }
    cursors[group].resize(tiles + kNowhereTiles);
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
    std::uint32_t* const cursor = cursors[group].data();
    TileEntry<T>* const entries = band.entries.data();
    const auto [begin, end] = share(chunks, group, groups);
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const std::uint32_t first_slot = std::uint32_t(chunk * kChunkSize);
      std::uint32_t gradient = band.first_gradients[chunk];
      for (std::uint32_t slot = first_slot; slot < first_slot + splats.counts[chunk]; ++slot) {
        const SplatKey<T> key = splats.keys[slot];
        const TileRect rect = clip(key.rect, band);
        const auto put = [&](int tile, std::uint32_t rank, int one) {
          entries[cursor[tile]] = {slot, gradient + rank, key.depth};
          __builtin_prefetch(entries + cursor[tile] + kPrefetchDistance, 1);
          cursor[tile] += one;
        };
        if (simple && within_four(rect)) {
          for_each_tile_of_four(rect, setup.tiles_x, nowhere, put);
        } else {
          for_each_tile(rect, band, setup.tiles_x, wanted,
                        [&](int tile, std::uint32_t rank) { put(tile, rank, 1); });
        }
        gradient += area(rect);
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
