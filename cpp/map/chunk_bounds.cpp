#include "gslts/map/chunk_bounds.hpp"

#include <algorithm>
#include <limits>

#include "gslts/map/gaussian_map.hpp"

namespace gslts {

template <typename T>
ChunkBounds chunk_bounds(const GaussianView<T>& gaussians, const char* function) {
  validate(gaussians, function);
  require_finite(gaussians, function);
  constexpr T kHuge = std::numeric_limits<T>::max();
  ChunkBounds bounds;
  bounds.size = gaussians.size;
  for (std::size_t begin = 0; begin < gaussians.size; begin += kChunkSize) {
    const std::size_t end = std::min(begin + kChunkSize, gaussians.size);
    T low[3] = {kHuge, kHuge, kHuge}, high[3] = {-kHuge, -kHuge, -kHuge};
    T max_log_scale = -kHuge;
    for (std::size_t row = begin; row < end; ++row) {
      for (int i = 0; i < 3; ++i) {
        low[i] = std::min(low[i], gaussians.means[3 * row + i]);
        high[i] = std::max(high[i], gaussians.means[3 * row + i]);
        max_log_scale = std::max(max_log_scale, gaussians.log_scales[3 * row + i]);
      }
    }
    bounds.chunks.push_back(
        {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}, double(max_log_scale)});
  }
  return bounds;
}

template ChunkBounds chunk_bounds(const GaussianView<float>&, const char*);
template ChunkBounds chunk_bounds(const GaussianView<double>&, const char*);

}  // namespace gslts
