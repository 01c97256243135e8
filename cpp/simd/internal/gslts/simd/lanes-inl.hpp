// Vectors of lanes and their sums, shared by the kernels of all libraries. Included once per
// instruction set by Highway's foreach_target.h, hence the toggling guard.

#if defined(GSLTS_SIMD_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_SIMD_LANES_INL_HPP
#undef GSLTS_SIMD_LANES_INL_HPP
#else
#define GSLTS_SIMD_LANES_INL_HPP
#endif

#include "hwy/highway.h"

#include <cstddef>

#include "gslts/simd/lanes.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::simd::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Results are the same bits on every instruction set with fused multiply-add (AVX2, AVX-512, NEON):
// - The compiler fuses nothing by itself (-ffp-contract=off): what is written as MulAdd is fused.
// - Sums over pixels or Gaussians are kept as kLanes partial sums, in as many vectors as that
// takes,
//   and are added up in one order (`sum_of`).
// - Instructions whose result depends on the machine, such as approximate reciprocals, decide only
//   how much work is done.

/// Lanes of T: as many as the machine has, at most kLanes.
template <typename T>
using Lanes = hn::CappedTag<T, kLanes>;

/// Number of vectors that hold kLanes numbers.
template <class D>
constexpr std::size_t kVectors = kLanes / hn::MaxLanes(D());

/// Adds up the 128-bit parts of a vector: the upper half to the lower one, and so on.
template <class D>
HWY_INLINE auto sum_parts([[maybe_unused]] D d, hn::Vec<D> v) {
  if constexpr (hn::MaxLanes(D()) * sizeof(hn::TFromD<D>) <= 16) {
    return v;
  } else {
    const hn::Half<D> half;
    return sum_parts(half, hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  }
}

/// Adds up kCount vectors, the second half to the first one, and so on.
template <std::size_t kCount, class V>
HWY_INLINE V sum_vectors(const V* vectors) {
  if constexpr (kCount == 1) {
    return vectors[0];
  } else {
    V sums[kCount / 2];
    for (std::size_t i = 0; i < kCount / 2; ++i) {
      sums[i] = hn::Add(vectors[i], vectors[i + kCount / 2]);
    }
    return sum_vectors<kCount / 2>(sums);
  }
}

/// The sum of kLanes partial sums.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE T sum_of(D d, const hn::Vec<D>* partial) {
  constexpr std::size_t kPart = 16 / sizeof(T);
  const hn::FixedTag<T, kPart> part;
  HWY_ALIGN T sums[kPart];
  hn::Store(sum_parts(d, sum_vectors<kVectors<D>>(partial)), part, sums);
  if constexpr (kPart == 2) return sums[0] + sums[1];
  return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}

}  // namespace gslts::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
