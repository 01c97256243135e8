#include "binning.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

/// Scratch tiles of each group, see `for_each_tile_of_four`. Three, because writing one of them
/// would have to wait for the write before.
constexpr std::size_t kScratchTiles = 3;

/// Visits the four tiles of 2 x 2 that most splats touch at most, without a branch, as which of
/// them they touch is not predictable: visit(tile, rank, increment) gets the untouched ones as one
/// of the tiles from `scratch` on, with an increment of 0.
template <typename Visit>
void for_each_tile_of_four(const TileRect& rect, int tiles_x, int scratch, Visit visit) {
  const int tile = rect.y0 * tiles_x + rect.x0;
  const int wide = rect.x1 - rect.x0 - 1, high = rect.y1 - rect.y0 - 1;
  visit(tile, 0, 1);
  visit(wide ? tile + 1 : scratch, 1, wide);
  visit(high ? tile + tiles_x : scratch + 1, 1 + wide, high);
  visit(wide & high ? tile + tiles_x + 1 : scratch + 2, 3, wide & high);
}

bool within_four(const TileRect& rect) { return rect.x1 - rect.x0 <= 2 && rect.y1 - rect.y0 <= 2; }

/// Counts the rectangles over each tile, from their corners alone.
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

/// Sorts the splats of a band into the lists of its tiles: a counting sort by groups of chunks, one
/// a thread. The lists come out in slot order whatever the number of groups.
template <typename T>
class TileLists {
 public:
  TileLists(const Splats<T>& splats, const RenderSetup<T>& setup, const WantedPixels& wanted,
            Band<T>& band)
      : splats_(splats),
        setup_(setup),
        wanted_(wanted),
        band_(band),
        chunks_(splats.counts.size()),
        tiles_(std::size_t(band.last_row - band.first_row) * setup.tiles_x),
        cursors_(std::max<std::size_t>(1, std::min<std::size_t>(setup.threads, chunks_))) {}

  void fill() {
    band_.first_gradients.assign(chunks_ + 1, 0);
    for_each_group([&](std::size_t group) { count(group); });
    std::partial_sum(band_.first_gradients.begin(), band_.first_gradients.end(),
                     band_.first_gradients.begin());
    place_lists();
    const std::uint32_t size = band_.offsets.back();
    add_scratch(size);
    for_each_group([&](std::size_t group) { write(group); });
    band_.entries.resize(size);
  }

 private:
  template <typename Task>
  void for_each_group(Task task) {
    parallel::parallel_for(cursors_.size(), setup_.threads, task);
  }

  template <typename Visit>
  void for_each_chunk(std::size_t group, Visit visit) const {
    const std::size_t groups = cursors_.size();
    for (std::size_t chunk = chunks_ * group / groups; chunk < chunks_ * (group + 1) / groups;
         ++chunk) {
      visit(chunk);
    }
  }

  /// Counts the entries of each tile, and the gradients of each chunk.
  void count(std::size_t group) {
    TileCounts counts(band_.last_row - band_.first_row, setup_.tiles_x);
    for_each_chunk(group, [&](std::size_t chunk) {
      const SplatKey<T>* keys = splats_.keys.data() + chunk * kChunkSize;
      std::uint32_t gradients = 0;
      for (std::uint32_t i = 0; i < splats_.counts[chunk]; ++i) {
        const TileRect rect = clip(keys[i].rect, band_);
        counts.add(rect, band_.first_row);
        gradients += area(rect);
      }
      band_.first_gradients[chunk + 1] = gradients;
    });
    cursors_[group] = counts.counts();
    const int first_tile = band_.first_row * setup_.tiles_x;
    for (std::size_t tile = 0; tile < tiles_ && !wanted_.all(); ++tile) {
      if (!wanted_.blocks(first_tile + int(tile))) cursors_[group][tile] = 0;
    }
  }

  /// Turns the counts into the entry at which each group starts in each list.
  void place_lists() {
    band_.offsets.resize(tiles_ + 1);
    std::uint32_t offset = 0;
    for (std::size_t tile = 0; tile < tiles_; ++tile) {
      band_.offsets[tile] = offset;
      for (std::vector<std::uint32_t>& cursor : cursors_) {
        offset += std::exchange(cursor[tile], offset);
      }
    }
    band_.offsets[tiles_] = offset;
  }

  /// Gives each group scratch tiles with entries of its own behind the lists.
  void add_scratch(std::uint32_t size) {
    band_.entries.resize(size + cursors_.size() * kScratchTiles);
    for (std::vector<std::uint32_t>& cursor : cursors_) {
      for (std::size_t i = 0; i < kScratchTiles; ++i) cursor.push_back(size++);
    }
  }

  /// Writes the entries of a group.
  void write(std::size_t group) {
    std::uint32_t* const cursor = cursors_[group].data();
    TileEntry<T>* const entries = band_.entries.data();
    const bool whole_image =
        wanted_.all() && band_.first_row == 0 && band_.last_row == setup_.tiles_y;
    for_each_chunk(group, [&](std::size_t chunk) {
      const std::uint32_t first_slot = std::uint32_t(chunk * kChunkSize);
      std::uint32_t gradient = band_.first_gradients[chunk];
      for (std::uint32_t slot = first_slot; slot < first_slot + splats_.counts[chunk]; ++slot) {
        const SplatKey<T> key = splats_.keys[slot];
        const TileRect rect = clip(key.rect, band_);
        const auto put = [&](int tile, std::uint32_t rank, int increment) {
          entries[cursor[tile]] = {slot, gradient + rank, key.depth};
          // The lists grow in no order, and every new cache line would otherwise be waited for.
          __builtin_prefetch(entries + cursor[tile] + kBinPrefetch, 1);
          cursor[tile] += increment;
        };
        if (whole_image && within_four(rect)) {
          for_each_tile_of_four(rect, setup_.tiles_x, int(tiles_), put);
        } else {
          for_each_tile(rect, band_, setup_.tiles_x, wanted_,
                        [&](int tile, std::uint32_t rank) { put(tile, rank, 1); });
        }
        gradient += area(rect);
      }
    });
  }

  const Splats<T>& splats_;
  const RenderSetup<T>& setup_;
  const WantedPixels& wanted_;
  Band<T>& band_;
  const std::size_t chunks_, tiles_;
  std::vector<std::vector<std::uint32_t>> cursors_;  ///< [groups][tiles + scratch tiles]
};

/// Counts the entries of each row of tiles.
template <typename T>
std::vector<std::uint64_t> count_by_row(const Splats<T>& splats, int rows) {
  std::vector<std::uint64_t> counts(rows, 0);
  for (std::size_t chunk = 0; chunk < splats.counts.size(); ++chunk) {
    const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      const TileRect& rect = keys[i].rect;
      for (int y = rect.y0; y < rect.y1; ++y) counts[y] += rect.x1 - rect.x0;
    }
  }
  return counts;
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
  const std::vector<std::uint64_t> row_entries = count_by_row(splats, setup.tiles_y);
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
  TileLists<T>(splats, setup, wanted, band).fill();
}

template std::vector<Band<float>> plan_bands(const Splats<float>&, const RenderSetup<float>&);
template std::vector<Band<double>> plan_bands(const Splats<double>&, const RenderSetup<double>&);
template void bin_splats(const Splats<float>&, const RenderSetup<float>&, const WantedPixels&,
                         Band<float>&);
template void bin_splats(const Splats<double>&, const RenderSetup<double>&, const WantedPixels&,
                         Band<double>&);

}  // namespace gslts::raster
