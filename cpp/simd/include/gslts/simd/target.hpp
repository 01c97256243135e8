#pragma once

#include <string>
#include <vector>

// Instruction set of the kernels: by default the best one of the machine. The environment variable
// GSLTS_SIMD, read before the first kernel runs, selects another one. Results are bit-identical
// with avx2, avx512 and neon; sse4 has no fused multiply-add and rounds differently.

namespace gslts::simd {

/// Returns the name of the instruction set in use: sse4, avx2, avx512 or neon.
/// @throws std::invalid_argument  if GSLTS_SIMD names no instruction set of this machine.
std::string target();

/// Returns the names of the instruction sets that this machine can use, the best first.
std::vector<std::string> targets();

/// Selects the instruction set of the kernels. Call it while no kernel runs.
/// @param name  One of `targets`.
/// @throws std::invalid_argument  if `name` is not in `targets`.
void use_target(const std::string& name);

/// Restricts the kernels to the instruction set that GSLTS_SIMD names, once. Whatever runs a kernel
/// calls it first.
/// @throws std::invalid_argument  if this machine cannot use it.
void apply_environment();

}  // namespace gslts::simd
