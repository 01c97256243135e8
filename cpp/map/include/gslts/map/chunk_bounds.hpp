#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace gslts {

template <typename T>
struct GaussianView;

/// Number of consecutive Gaussians of a chunk, the unit in which a map is culled and projected; few
/// enough for their parameters to stay in the L2 cache.
constexpr std::size_t kChunkSize = 1024;

/// Bounds of every chunk of a map: an index by which a renderer skips the chunks out of view. It
/// skips most of a large map if Gaussians that are near each other are so in the arrays, too; the
/// images are the same in any order.
struct ChunkBounds {
  struct Box {
    double low[3], high[3];  ///< Box of the centres, m, in the frame of the map.
    double max_log_scale;    ///< Log of the largest standard deviation in m.
  };

  std::size_t size = 0;     ///< N, the Gaussians of the map.
  std::vector<Box> chunks;  ///< [(N + kChunkSize - 1) / kChunkSize]
  /// Called with the chunks that a renderer is about to read, before it reads them, or empty if all
  /// are in memory. It may throw; then nothing is rendered.
  std::function<void(const std::vector<std::uint32_t>&)> load = {};
};

/// Computes the bounds of a map.
/// @throws std::invalid_argument  naming the caller, if a number of the map is not finite.
template <typename T>
ChunkBounds chunk_bounds(const GaussianView<T>& gaussians, const char* function);

}  // namespace gslts
