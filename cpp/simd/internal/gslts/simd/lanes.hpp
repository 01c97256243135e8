#pragma once

namespace gslts::simd {

/// Number of partial sums that every kernel keeps, on every instruction set: the floats of one
/// AVX-512 vector.
constexpr int kLanes = 16;

}  // namespace gslts::simd
