#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "binning.hpp"

namespace gslts::raster {

/// Sorts the entries of a tile by depth, keeping the order of equal depths: a radix sort of as few
/// digits as the range of the depths needs. `scratch` is working memory.
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
  DepthBits<T> nearest = entries[0].depth, farthest = nearest;
  for (std::size_t i = 1; i < n; ++i) {
    nearest = std::min(nearest, entries[i].depth);
    farthest = std::max(farthest, entries[i].depth);
  }
  constexpr int kDigitBits = 9,
                kMaxDigits = (8 * int(sizeof(DepthBits<T>)) + kDigitBits - 1) / kDigitBits;
  int digits = 0;
  while (digits < kMaxDigits && (farthest - nearest) >> (kDigitBits * digits)) ++digits;
  const auto digit_of = [&](const TileEntry<T>& entry, int digit) {
    return ((entry.depth - nearest) >> (kDigitBits * digit)) & ((1 << kDigitBits) - 1);
  };
  std::array<std::array<std::uint32_t, 1 << kDigitBits>, kMaxDigits> histograms;
  for (int digit = 0; digit < digits; ++digit) histograms[digit].fill(0);
  for (std::size_t i = 0; i < n; ++i) {
    for (int digit = 0; digit < digits; ++digit) ++histograms[digit][digit_of(entries[i], digit)];
  }
  scratch.resize(n);
  TileEntry<T>*from = entries, *to = scratch.data();
  for (int digit = 0; digit < digits; ++digit) {
    std::array<std::uint32_t, 1 << kDigitBits>& places = histograms[digit];
    std::uint32_t sum = 0;
    for (std::uint32_t& place : places) sum += std::exchange(place, sum);
    for (std::size_t i = 0; i < n; ++i) to[places[digit_of(from[i], digit)]++] = from[i];
    std::swap(from, to);
  }
  if (from != entries) std::copy(from, from + n, entries);
}

}  // namespace gslts::raster
