#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

namespace gslts::raster {

/// Bits of a positive floating-point number; they have the order of the numbers.
template <typename T>
using DepthBits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;

template <typename T>
inline DepthBits<T> depth_bits(T depth) {
  DepthBits<T> bits;
  std::memcpy(&bits, &depth, sizeof(bits));
  return bits;
}

template <typename T>
struct DepthItem {
  DepthBits<T> depth;
  std::uint32_t index;
};

/// Sorts by depth, keeping the order of equal depths: a radix sort, eight bits a pass, that skips
/// the digits which all share. `scratch` is working memory.
template <typename T>
void sort_by_depth(std::vector<DepthItem<T>>& items, std::vector<DepthItem<T>>& scratch) {
  constexpr std::size_t kInsertionSortSize = 48;
  const std::size_t n = items.size();
  if (n <= kInsertionSortSize) {
    for (std::size_t i = 1; i < n; ++i) {
      const DepthItem<T> item = items[i];
      std::size_t j = i;
      for (; j > 0 && items[j - 1].depth > item.depth; --j) items[j] = items[j - 1];
      items[j] = item;
    }
    return;
  }
  constexpr int kDigits = sizeof(DepthBits<T>);
  std::array<std::array<std::uint32_t, 256>, kDigits> histograms{};
  for (const DepthItem<T>& item : items) {
    for (int digit = 0; digit < kDigits; ++digit) {
      ++histograms[digit][(item.depth >> (8 * digit)) & 255];
    }
  }
  scratch.resize(n);
  for (int digit = 0; digit < kDigits; ++digit) {
    std::array<std::uint32_t, 256>& places = histograms[digit];
    if (places[(items[0].depth >> (8 * digit)) & 255] == n) continue;
    std::uint32_t sum = 0;
    for (std::uint32_t& place : places) sum += std::exchange(place, sum);
    for (const DepthItem<T>& item : items) {
      scratch[places[(item.depth >> (8 * digit)) & 255]++] = item;
    }
    items.swap(scratch);
  }
}

}  // namespace gslts::raster
