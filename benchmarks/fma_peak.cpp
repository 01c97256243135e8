#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fma_peak.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include "fma_peak.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::benchmarks::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kUnroll = 16;  // Multiply-adds of an accumulator in a row, against the loop's cost.

std::int64_t Lanes() { return std::int64_t(hn::Lanes(hn::ScalableTag<float>())); }

std::int64_t RunFma(std::int64_t rounds) {
  const hn::ScalableTag<float> d;
  // 12 chains fill two units of latency 4 to 6 and leave registers for the factors in AVX2's 16.
  const auto factor = hn::Set(d, 0.999f), term = hn::Set(d, 1e-3f);
  auto a0 = hn::Set(d, 0.0f), a1 = hn::Set(d, 0.1f), a2 = hn::Set(d, 0.2f), a3 = hn::Set(d, 0.3f);
  auto a4 = hn::Set(d, 0.4f), a5 = hn::Set(d, 0.5f), a6 = hn::Set(d, 0.6f), a7 = hn::Set(d, 0.7f);
  auto a8 = hn::Set(d, 0.8f), a9 = hn::Set(d, 0.9f), a10 = hn::Set(d, 1.0f), a11 = hn::Set(d, 1.1f);
  for (std::int64_t i = 0; i < rounds; ++i) {
    for (int j = 0; j < kUnroll; ++j) {
      a0 = hn::MulAdd(a0, factor, term);
      a1 = hn::MulAdd(a1, factor, term);
      a2 = hn::MulAdd(a2, factor, term);
      a3 = hn::MulAdd(a3, factor, term);
      a4 = hn::MulAdd(a4, factor, term);
      a5 = hn::MulAdd(a5, factor, term);
      a6 = hn::MulAdd(a6, factor, term);
      a7 = hn::MulAdd(a7, factor, term);
      a8 = hn::MulAdd(a8, factor, term);
      a9 = hn::MulAdd(a9, factor, term);
      a10 = hn::MulAdd(a10, factor, term);
      a11 = hn::MulAdd(a11, factor, term);
    }
  }
  a0 =
      hn::Add(hn::Add(hn::Add(a0, a1), hn::Add(a2, a3)), hn::Add(hn::Add(a4, a5), hn::Add(a6, a7)));
  a0 = hn::Add(a0, hn::Add(hn::Add(a8, a9), hn::Add(a10, a11)));
  // The volatile store keeps the compiler from dropping the arithmetic.
  volatile float sink = hn::GetLane(hn::SumOfLanes(d, a0));
  (void)sink;
  return rounds * kUnroll * 12 * Lanes();
}

}  // namespace gslts::benchmarks::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::benchmarks {

HWY_EXPORT(Lanes);
HWY_EXPORT(RunFma);

std::int64_t run_fma(std::int64_t rounds) { return HWY_DYNAMIC_DISPATCH(RunFma)(rounds); }
std::int64_t fma_lanes() { return HWY_DYNAMIC_DISPATCH(Lanes)(); }

}  // namespace gslts::benchmarks
#endif
