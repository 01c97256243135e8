#include "ply_layout.hpp"

#include <algorithm>
#include <functional>

namespace gslts::io {

std::optional<std::uint64_t> repeated_id(const std::uint64_t* ids, std::size_t size) {
  // Ascending ids, the usual case, need no sorting.
  if (std::adjacent_find(ids, ids + size, std::greater_equal<>()) == ids + size) return {};
  std::vector<std::uint64_t> sorted(ids, ids + size);
  std::sort(sorted.begin(), sorted.end());
  const auto repeated = std::adjacent_find(sorted.begin(), sorted.end(), std::equal_to<>());
  if (repeated == sorted.end()) return {};
  return *repeated;
}

}  // namespace gslts::io
