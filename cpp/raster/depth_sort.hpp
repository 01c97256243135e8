#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "binning.hpp"

namespace gslts::raster {

/// Sorts the entries of a tile by depth, keeping the order of equal depths: a radix sort, eight bits
/// a pass, that skips the digits which all share. `scratch` is working memory.
template <typename T>
void sort_by_depth(TileEntry<T>* entries, std::size_t n, std::vector<TileEntry<T>>& scratch) {
  constexpr std::size_t kInsertionSortSize = 48;
  if (n <= kInsertionSortSize) {
    for (std::size_t i = 1; i < n; ++i) {
      const TileEntry<T> entry = entries[i];
      std::size_t j = i;
      for (; j > 0 && entries[j - 1].depth > entry.depth; --j) entries[j] = entries[j - 1];
      entries[j] = entry;
    }
    return;
  }
  constexpr int kDigits = sizeof(DepthBits<T>);
  std::array<std::array<std::uint32_t, 256>, kDigits> histograms{};
  for (std::size_t i = 0; i < n; ++i) {
    for (int digit = 0; digit < kDigits; ++digit) {
      ++histograms[digit][(entries[i].depth >> (8 * digit)) & 255];
    }
  }
  scratch.resize(n);
  TileEntry<T>*from = entries, *to = scratch.data();
  for (int digit = 0; digit < kDigits; ++digit) {
    std::array<std::uint32_t, 256>& places = histograms[digit];
    if (places[(entries[0].depth >> (8 * digit)) & 255] == n) continue;
    std::uint32_t sum = 0;
    for (std::uint32_t& place : places) sum += std::exchange(place, sum);
    for (std::size_t i = 0; i < n; ++i) {
      to[places[(from[i].depth >> (8 * digit)) & 255]++] = from[i];
    }
    std::swap(from, to);
  }
  if (from != entries) std::copy(from, from + n, entries);
}

}  // namespace gslts::raster
