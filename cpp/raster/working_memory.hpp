#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace gslts::raster {

/// Resizes working memory that is kept from render to render and read in no order: in huge pages,
/// where the system grants them, since most of such reads would miss the TLB otherwise.
template <typename T>
void resize_working_memory(Array<T>& array, std::size_t size) {
  const bool grows = size > array.capacity();
  array.resize(size);
#ifdef __linux__
  constexpr std::size_t kHugePage = std::size_t{2} << 20, kPage = 4096;
  if (!grows || size * sizeof(T) < 2 * kHugePage) return;
  const auto begin = reinterpret_cast<std::uintptr_t>(array.data());
  const std::uintptr_t first = (begin + kPage - 1) / kPage * kPage;
  // Only advice: a refusal changes nothing but the speed.
  madvise(reinterpret_cast<void*>(first), begin + size * sizeof(T) - first, MADV_HUGEPAGE);
#else
  (void)grows;
#endif
}

}  // namespace gslts::raster
