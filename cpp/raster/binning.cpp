#include "binning.hpp"

#include <algorithm>
#include <numeric>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

template <typename Visit>
void for_each_tile(const TileRect& rect, const Band& band, int tiles_x, const WantedPixels& wanted,
                   Visit visit) {
  const int y1 = std::min<int>(rect.y1, band.last_row);
  for (int y = std::max<int>(rect.y0, band.first_row); y < y1; ++y) {
    for (int x = rect.x0; x < rect.x1; ++x) {
      if (wanted.all() || wanted.blocks(y * tiles_x + x)) visit((y - band.first_row) * tiles_x + x);
    }
  }
}

/// Chunks [begin, end) of one of `groups` equal shares.
std::pair<std::size_t, std::size_t> share(std::size_t chunks, std::size_t group,
                                          std::size_t groups) {
  return {chunks * group / groups, chunks * (group + 1) / groups};
}

}  // namespace

std::uint32_t count_entries(const TileRect& rect, const Band& band, int tiles_x,
                            const WantedPixels& wanted) {
  if (wanted.all()) {
    const int rows = std::min<int>(rect.y1, band.last_row) - std::max<int>(rect.y0, band.first_row);
    return rows > 0 ? std::uint32_t(rows * (rect.x1 - rect.x0)) : 0;
  }
  std::uint32_t count = 0;
  for_each_tile(rect, band, tiles_x, wanted, [&](int) { ++count; });
  return count;
}

template <typename T>
std::vector<Band> plan_bands(const Splats<T>& splats, const RenderSetup<T>& setup) {
  std::vector<std::uint64_t> row_entries(setup.tiles_y + 1, 0);
  std::uint64_t visible = 0, total = 0;
  for (std::size_t chunk = 0; chunk < splats.counts.size(); ++chunk) {
    const TileRect* rects = splats.rects.data() + chunk * kChunkSize;
    visible += splats.counts[chunk];
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      total += std::uint64_t(rects[i].x1 - rects[i].x0) * (rects[i].y1 - rects[i].y0);
    }
  }
  const std::uint64_t budget = std::max<std::uint64_t>(kMinBandEntries, 4 * visible);
  if (total <= budget) {
    Band whole;
    whole.last_row = setup.tiles_y;
    return {whole};
  }
  for (std::size_t chunk = 0; chunk < splats.counts.size(); ++chunk) {
    const TileRect* rects = splats.rects.data() + chunk * kChunkSize;
    for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
      for (int y = rects[i].y0; y < rects[i].y1; ++y) row_entries[y] += rects[i].x1 - rects[i].x0;
    }
  }
  std::vector<Band> bands;
  std::uint64_t entries = 0;
  for (int row = 0; row < setup.tiles_y; ++row) {
    if (bands.empty() || entries + row_entries[row] > budget) {
      bands.emplace_back();
      bands.back().first_row = row;
      entries = 0;
    }
    bands.back().last_row = row + 1;
    entries += row_entries[row];
  }
  return bands;
}

template <typename T>
void bin_splats(const Splats<T>& splats, const RenderSetup<T>& setup, const WantedPixels& wanted,
                Band& band) {
  const std::size_t chunks = splats.counts.size();
  const std::size_t tiles = std::size_t(band.last_row - band.first_row) * setup.tiles_x;
  const std::size_t groups = std::max<std::size_t>(1, std::min<std::size_t>(setup.threads, chunks));
  // A counting sort. The lists come out in slot order whatever the number of groups.
  std::vector<std::vector<std::uint32_t>> cursors(groups);
  band.first_gradients.assign(chunks + 1, 0);
  parallel::parallel_for(groups, setup.threads, [&](std::size_t group) {
    std::vector<std::uint32_t>& counts = cursors[group];
    counts.assign(tiles, 0);
    const auto [begin, end] = share(chunks, group, groups);
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const TileRect* rects = splats.rects.data() + chunk * kChunkSize;
      std::uint32_t entries = 0;
      for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
        for_each_tile(rects[i], band, setup.tiles_x, wanted, [&](int tile) {
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
  band.entries.resize(offset);
  parallel::parallel_for(groups, setup.threads, [&](std::size_t group) {
    std::vector<std::uint32_t>& cursor = cursors[group];
    const auto [begin, end] = share(chunks, group, groups);
    std::uint32_t gradient = band.first_gradients[begin];
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const std::uint32_t first_slot = std::uint32_t(chunk * kChunkSize);
      for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
        for_each_tile(splats.rects[first_slot + i], band, setup.tiles_x, wanted, [&](int tile) {
          band.entries[cursor[tile]++] = {first_slot + i, gradient++};
        });
      }
    }
  });
}

template std::vector<Band> plan_bands(const Splats<float>&, const RenderSetup<float>&);
template std::vector<Band> plan_bands(const Splats<double>&, const RenderSetup<double>&);
template void bin_splats(const Splats<float>&, const RenderSetup<float>&, const WantedPixels&,
                         Band&);
template void bin_splats(const Splats<double>&, const RenderSetup<double>&, const WantedPixels&,
                         Band&);

}  // namespace gslts::raster
