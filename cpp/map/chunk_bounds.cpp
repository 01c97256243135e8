#include "gslts/map/chunk_bounds.hpp"

#include <algorithm>
#include <limits>

#include "gslts/map/gaussian_map.hpp"

namespace gslts {

template <typename T>
ChunkBounds chunk_bounds(const GaussianView<T>& gaussians) {
  validate(gaussians, "chunk_bounds");
  constexpr T kHuge = std::numeric_limits<T>::max();
  ChunkBounds bounds;
  bounds.size = gaussians.size;
  for (std::size_t begin = 0; begin < gaussians.size; begin += kChunkSize) {
    const std::size_t end = std::min(begin + kChunkSize, gaussians.size);
    T low[3] = {kHuge, kHuge, kHuge}, high[3] = {-kHuge, -kHuge, -kHuge};
    T max_log_scale = -kHuge, zeros = 0;  // x * 0 is 0 for finite x and NaN otherwise.
    for (std::size_t row = begin; row < end; ++row) {
      for (int i = 0; i < 3; ++i) {
        const T mean = gaussians.means[3 * row + i], scale = gaussians.log_scales[3 * row + i];
        low[i] = std::min(low[i], mean);
        high[i] = std::max(high[i], mean);
        max_log_scale = std::max(max_log_scale, scale);
        zeros += mean * T(0) + scale * T(0);
      }
    }
    if (zeros != T(0)) require_finite(gaussians, "chunk_bounds");
    bounds.chunks.push_back(
        {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}, double(max_log_scale)});
  }
  return bounds;
}

template ChunkBounds chunk_bounds(const GaussianView<float>&);
template ChunkBounds chunk_bounds(const GaussianView<double>&);

}  // namespace gslts
