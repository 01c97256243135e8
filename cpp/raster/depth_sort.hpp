#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "binning.hpp"

namespace gslts::raster {

/// Sorts few entries by depth, keeping the order of equal depths.
template <typename T>
void insertion_sort(TileEntry<T>* entries, std::size_t n) {
  for (std::size_t i = 1; i < n; ++i) {
    const TileEntry<T> entry = entries[i];
    std::size_t j = i;
    for (; j > 0 && entries[j - 1].depth > entry.depth; --j) entries[j] = entries[j - 1];
    entries[j] = entry;
  }
}

/// Sorts entries by depth, keeping the order of equal depths, by as few digits as the range of the
/// depths needs.
template <typename T>
void radix_sort(TileEntry<T>* entries, std::size_t n, std::vector<TileEntry<T>>& scratch) {
  DepthBits<T> nearest = entries[0].depth, farthest = nearest;
  for (std::size_t i = 1; i < n; ++i) {
    nearest = std::min(nearest, entries[i].depth);
    farthest = std::max(farthest, entries[i].depth);
  }
  constexpr int kDepthBits = 8 * int(sizeof(DepthBits<T>));
  constexpr int kMaxDigits = (kDepthBits + kSortDigitBits - 1) / kSortDigitBits;
  int digits = 0;
  while (digits < kMaxDigits && (farthest - nearest) >> (kSortDigitBits * digits)) ++digits;
  const auto digit_of = [&](const TileEntry<T>& entry, int digit) {
    return ((entry.depth - nearest) >> (kSortDigitBits * digit)) & ((1 << kSortDigitBits) - 1);
  };
  std::array<std::array<std::uint32_t, 1 << kSortDigitBits>, kMaxDigits> histograms;
  for (int digit = 0; digit < digits; ++digit) histograms[digit].fill(0);
  for (std::size_t i = 0; i < n; ++i) {
    for (int digit = 0; digit < digits; ++digit) ++histograms[digit][digit_of(entries[i], digit)];
  }
  scratch.resize(n);
  TileEntry<T>*from = entries, *to = scratch.data();
  for (int digit = 0; digit < digits; ++digit) {
    std::array<std::uint32_t, 1 << kSortDigitBits>& starts = histograms[digit];
    std::uint32_t sum = 0;
    for (std::uint32_t& start : starts) sum += std::exchange(start, sum);
    for (std::size_t i = 0; i < n; ++i) to[starts[digit_of(from[i], digit)]++] = from[i];
    std::swap(from, to);
  }
  if (from != entries) std::copy(from, from + n, entries);
}

/// Sorts the entries of a tile by depth, keeping the order of equal depths.
/// @param scratch  Working memory.
template <typename T>
void sort_by_depth(TileEntry<T>* entries, std::size_t n, std::vector<TileEntry<T>>& scratch) {
  if (n <= kMaxInsertionSort) {
    insertion_sort(entries, n);
  } else {
    radix_sort(entries, n, scratch);
  }
}

}  // namespace gslts::raster
