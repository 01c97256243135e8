// Small vector functions that the kernels share. Included once per instruction set by Highway's
// foreach_target.h, hence the toggling guard.

#if defined(GSLTS_RASTER_SIMD_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_SIMD_INL_HPP
#undef GSLTS_RASTER_SIMD_INL_HPP
#else
#define GSLTS_RASTER_SIMD_INL_HPP
#endif

#include "hwy/highway.h"

#include "constants.hpp"
#include "gslts/simd/lanes-inl.hpp"
#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using namespace simd::HWY_NAMESPACE;  // Lanes and their sums, in one order everywhere.

/// Dot product of two vectors of three numbers.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V dot3(const V* a, const V* b) {
  return hn::MulAdd(a[2], b[2], hn::MulAdd(a[1], b[1], hn::Mul(a[0], b[0])));
}

/// Enlarges the squared radius of a footprint by more than its rounding error, so that no pixel is
/// lost.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V enlarge(D d, V squared_radius) {
  using T = hn::TFromD<D>;
  return hn::MulAdd(squared_radius, hn::Set(d, T(1 + kRoundingMargin)),
                    hn::Set(d, T(kRoundingMargin)));
}

/// 2^x for finite x in [-126, 0]; any value for smaller x. In float by the minimax polynomial of
/// 2^f on [-1/2, 1/2], with a relative error below 3e-7 for degree 5 and 8e-5 for degree 3; in
/// double below 1e-15.
template <int kDegree, class D, hwy::EnableIf<sizeof(hn::TFromD<D>) == 4>* = nullptr>
HWY_INLINE hn::Vec<D> exp2_nonpositive(D d, hn::Vec<D> x) {
  static_assert(kDegree == 3 || kDegree == 5);
  const hn::RebindToSigned<D> di;
  // Adding 1.5 * 2^23 rounds to an integer, which then stands in the lowest bits.
  const auto magic = hn::Set(d, 12582912.0f);
  const auto shifted = hn::Add(x, magic);
  const auto f = hn::Sub(x, hn::Sub(shifted, magic));
  // Estrin's scheme: three steps deep instead of Horner's five.
  const auto f2 = hn::Mul(f, f);
  hn::Vec<D> p;
  if constexpr (kDegree == 5) {
    const auto p01 = hn::MulAdd(hn::Set(d, 6.931469671e-1f), f, hn::Set(d, 1.0f));
    const auto p23 = hn::MulAdd(hn::Set(d, 5.550713273e-2f), f, hn::Set(d, 2.402211972e-1f));
    const auto p45 = hn::MulAdd(hn::Set(d, 1.327647199e-3f), f, hn::Set(d, 9.675541334e-3f));
    p = hn::MulAdd(hn::MulAdd(p45, f2, p23), f2, p01);
  } else {
    const auto p01 = hn::MulAdd(hn::Set(d, 6.932610941e-1f), f, hn::Set(d, 9.999280476e-1f));
    const auto p23 = hn::MulAdd(hn::Set(d, 5.517130429e-2f), f, hn::Set(d, 2.426113304e-1f));
    p = hn::MulAdd(p23, f2, p01);
  }
  const auto exponent = hn::ShiftLeft<23>(hn::BitCast(di, shifted));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), exponent));
}
template <int kDegree, class D, hwy::EnableIf<sizeof(hn::TFromD<D>) == 8>* = nullptr>
HWY_INLINE hn::Vec<D> exp2_nonpositive(D d, hn::Vec<D> x) {
  return hn::Exp(d, hn::Mul(x, hn::Set(d, kLn2)));
}

/// sqrt(max(x, 0)), in float with a relative error of at most kApproximateSqrtError: that of NEON's
/// estimate, those of x86 are better.
template <typename T>
constexpr T kApproximateSqrtError = sizeof(T) == 4 ? T(1) / 256 : T(0);
template <class D, hwy::EnableIf<sizeof(hn::TFromD<D>) == 4>* = nullptr>
HWY_INLINE hn::Vec<D> approximate_sqrt(D d, hn::Vec<D> x) {
  const auto positive = hn::Max(x, hn::Set(d, 1e-30f));
  return hn::Mul(positive, hn::ApproximateReciprocalSqrt(positive));
}
template <class D, hwy::EnableIf<sizeof(hn::TFromD<D>) == 8>* = nullptr>
HWY_INLINE hn::Vec<D> approximate_sqrt(D d, hn::Vec<D> x) {
  return hn::Sqrt(hn::Max(x, hn::Zero(d)));
}

/// Sums one number for each pixel of a block.
template <typename T>
HWY_INLINE T sum_of_pixels(const T* values) {
  const Lanes<T> d;
  hn::Vec<Lanes<T>> vectors[kVectors<Lanes<T>>];
  for (std::size_t i = 0; i < kVectors<Lanes<T>>; ++i) {
    vectors[i] = hn::Load(d, values + i * hn::Lanes(d));
  }
  return sum_of(d, vectors);
}

/// Half as many lanes as a block has pixels, or as many as the machine has.
template <typename T>
using HalfLanes = hn::CappedTag<T, kBlockPixels / 2>;

/// Vector i of kBlockPixels / 2 partial sums: the second half of kBlockPixels added to the first.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<HalfLanes<T>> half_sums([[maybe_unused]] D d, const hn::Vec<D>* partial,
                                           std::size_t i) {
  if constexpr (kVectors<D> == 1) {
    const HalfLanes<T> half;
    return hn::Add(hn::LowerHalf(half, partial[0]), hn::UpperHalf(half, partial[0]));
  } else {
    return hn::Add(partial[i], partial[i + kVectors<D> / 2]);
  }
}

/// Sums over the pixels of four values, side by side in each 128-bit part (float), or of two.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V add_within_parts(D d, V a, V b, V c, V e) {
  const hn::RepartitionToWide<D> wide;
  const V ab = hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const V ce = hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e));
  const auto ab_pairs = hn::BitCast(wide, ab), ce_pairs = hn::BitCast(wide, ce);
  return hn::Add(hn::BitCast(d, hn::InterleaveLower(wide, ab_pairs, ce_pairs)),
                 hn::BitCast(d, hn::InterleaveUpper(wide, ab_pairs, ce_pairs)));
}
template <class D, class V = hn::Vec<D>>
HWY_INLINE V add_within_parts(D d, V a, V b) {
  return hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
}

/// Stores the sums of each of four values of which kBlockPixels partial sums are given.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_sums(D d, const hn::Vec<D>* a, const hn::Vec<D>* b, const hn::Vec<D>* c,
                           const hn::Vec<D>* e, T* out) {
  const HalfLanes<T> half;
  constexpr std::size_t kHalfVectors = kBlockPixels / 2 / hn::MaxLanes(HalfLanes<T>());
  using V = hn::Vec<HalfLanes<T>>;
  if constexpr (sizeof(T) == 4) {
    V sums[kHalfVectors];
    for (std::size_t i = 0; i < kHalfVectors; ++i) {
      sums[i] = add_within_parts(half, half_sums(d, a, i), half_sums(d, b, i), half_sums(d, c, i),
                                 half_sums(d, e, i));
    }
    hn::StoreU(sum_parts(half, sum_vectors<kHalfVectors>(sums)), hn::FixedTag<T, 4>(), out);
  } else {
    V ab[kHalfVectors], ce[kHalfVectors];
    for (std::size_t i = 0; i < kHalfVectors; ++i) {
      ab[i] = add_within_parts(half, half_sums(d, a, i), half_sums(d, b, i));
      ce[i] = add_within_parts(half, half_sums(d, c, i), half_sums(d, e, i));
    }
    const hn::FixedTag<T, 2> part;
    hn::StoreU(sum_parts(half, sum_vectors<kHalfVectors>(ab)), part, out);
    hn::StoreU(sum_parts(half, sum_vectors<kHalfVectors>(ce)), part, out + 2);
  }
}

// Rows of four numbers, one a lane, to four columns and back. In float a vector is made of the
// 128-bit rows of every fourth lane and transposed within its 128-bit parts. Writing single numbers
// to memory and reading them back as a vector would wait until all have left the store queue.

/// Loads the rows of lanes first, first + 4, ... side by side.
template <class D, class RowOf>
HWY_INLINE hn::Vec<D> load_every_fourth(D d, RowOf row_of, std::size_t first) {
  if constexpr (hn::MaxLanes(D()) <= 4) {
    return hn::LoadU(d, row_of(first));
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, load_every_fourth(half, row_of, first + hn::Lanes(half)),
                       load_every_fourth(half, row_of, first));
  }
}

template <class D, class RowOf>
HWY_INLINE void store_every_fourth(D d, hn::Vec<D> v, RowOf row_of, std::size_t first) {
  if constexpr (hn::MaxLanes(D()) <= 4) {
    hn::StoreU(v, d, row_of(first));
  } else {
    const hn::Half<D> half;
    store_every_fourth(half, hn::LowerHalf(half, v), row_of, first);
    store_every_fourth(half, hn::UpperHalf(half, v), row_of, first + hn::Lanes(half));
  }
}

/// Transposes four vectors within their 128-bit parts.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void transpose_parts(D d, V* rows) {
  const hn::RepartitionToWide<D> wide;
  const auto a = hn::BitCast(wide, hn::InterleaveLower(d, rows[0], rows[1]));
  const auto b = hn::BitCast(wide, hn::InterleaveLower(d, rows[2], rows[3]));
  const auto c = hn::BitCast(wide, hn::InterleaveUpper(d, rows[0], rows[1]));
  const auto e = hn::BitCast(wide, hn::InterleaveUpper(d, rows[2], rows[3]));
  rows[0] = hn::BitCast(d, hn::InterleaveLower(wide, a, b));
  rows[1] = hn::BitCast(d, hn::InterleaveUpper(wide, a, b));
  rows[2] = hn::BitCast(d, hn::InterleaveLower(wide, c, e));
  rows[3] = hn::BitCast(d, hn::InterleaveUpper(wide, c, e));
}

/// Loads the columns of the four numbers at row_of(lane).
template <class D, class RowOf>
HWY_INLINE void load_columns(D d, RowOf row_of, hn::Vec<D>* columns) {
  using T = hn::TFromD<D>;
  if constexpr (sizeof(T) == 4) {
    for (std::size_t i = 0; i < 4; ++i) columns[i] = load_every_fourth(d, row_of, i);
    transpose_parts(d, columns);
  } else {
    HWY_ALIGN T values[4][kBlockPixels];
    for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
      for (int i = 0; i < 4; ++i) values[i][lane] = row_of(lane)[i];
    }
    for (int i = 0; i < 4; ++i) columns[i] = hn::Load(d, values[i]);
  }
}

/// Stores four columns as rows of four numbers at row_of(lane), for lane < count.
template <class D, class RowOf>
HWY_INLINE void store_columns(D d, const hn::Vec<D>* columns, std::size_t count, RowOf row_of) {
  using T = hn::TFromD<D>;
  if constexpr (sizeof(T) == 4) {
    if (count == hn::Lanes(d)) {
      hn::Vec<D> rows[4] = {columns[0], columns[1], columns[2], columns[3]};
      transpose_parts(d, rows);
      for (std::size_t i = 0; i < 4; ++i) store_every_fourth(d, rows[i], row_of, i);
      return;
    }
  }
  HWY_ALIGN T values[4][kBlockPixels];
  for (int i = 0; i < 4; ++i) hn::Store(columns[i], d, values[i]);
  for (std::size_t lane = 0; lane < count; ++lane) {
    for (int i = 0; i < 4; ++i) row_of(lane)[i] = values[i][lane];
  }
}

/// Tests whether n numbers are all finite.
template <typename T>
bool all_finite(const T* values, std::size_t n) {
  const Lanes<T> d;
  const std::size_t lanes = hn::Lanes(d);
  const auto zero = hn::Zero(d);
  // x * 0 is 0 for finite x and NaN otherwise.
  auto sum0 = zero, sum1 = zero;
  const std::size_t whole = n - n % (2 * lanes);
  for (std::size_t i = 0; i < whole; i += 2 * lanes) {
    sum0 = hn::MulAdd(hn::LoadU(d, values + i), zero, sum0);
    sum1 = hn::MulAdd(hn::LoadU(d, values + i + lanes), zero, sum1);
  }
  T rest = 0;
  for (std::size_t i = whole; i < n; ++i) rest += values[i] * T(0);
  return hn::AllTrue(d, hn::Eq(hn::Add(sum0, sum1), zero)) && rest == T(0);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
