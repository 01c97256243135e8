#pragma once

#include <string>
#include <vector>

// The instruction set of the kernels. By default the best that the machine has; the environment
// variable GSLTS_SIMD, read before the first kernel runs, names another one. Results are the same
// bits with avx2, avx512 and neon. sse4 has no fused multiply-add and rounds differently.

namespace gslts::raster {

/// Name of the instruction set in use: sse4, avx2, avx512 or neon.
/// @throws std::invalid_argument  if GSLTS_SIMD names none that this machine can use.
std::string simd_target();

/// Names of the instruction sets that this machine can use, the best first.
std::vector<std::string> simd_targets();

/// Makes the kernels use an instruction set from now on. Call it while no kernel runs.
/// @throws std::invalid_argument  if `name` is not in `simd_targets`.
void use_simd_target(const std::string& name);

}  // namespace gslts::raster
