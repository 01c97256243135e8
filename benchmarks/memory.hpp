#pragma once

#include <string>

namespace gslts::benchmarks {

/// Peak memory of one render and its backward pass beyond what the caller holds, in bytes.
struct MemoryUse {
  std::size_t visible, pixels;
  /// Working memory and results; not the map, not the caller's gradients.
  std::size_t peak_bytes;
  std::size_t returned_bytes;  ///< Images and gradients that the calls return; part of the peak.

  double bound_bytes() const { return 300.0 * double(visible) + 64.0 * double(pixels); }
};

/// Measures in this process, which must not have rendered before (Linux: VmHWM of
/// /proc/self/status).
/// @throws std::runtime_error  if the system does not offer the measurement.
MemoryUse measure_memory(const std::string& folder, const std::string& name, int sh_degree,
                         int threads);

}  // namespace gslts::benchmarks
