#pragma once

#include <string>
#include <vector>

// The instruction set of the kernels. By default the best that the machine has; the environment
// variable GSLTS_SIMD, read before the first kernel runs, names another one. Results are the same
// bits with avx2, avx512 and neon. sse4 has no fused multiply-add and rounds differently.

namespace gslts::simd {

/// Name of the instruction set in use: sse4, avx2, avx512 or neon.
/// @throws std::invalid_argument  if GSLTS_SIMD names none that this machine can use.
std::string target();

/// Names of the instruction sets that this machine can use, the best first.
std::vector<std::string> targets();

/// Makes the kernels use an instruction set from now on. Call it while no kernel runs.
/// @throws std::invalid_argument  if `name` is not in `targets`.
void use_target(const std::string& name);

/// Restricts the kernels to the instruction set that GSLTS_SIMD names, once. Whatever runs a kernel
/// calls it first.
/// @throws std::invalid_argument  if this machine cannot use it.
void apply_environment();

}  // namespace gslts::simd
