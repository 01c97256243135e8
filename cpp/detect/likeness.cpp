#include <algorithm>
#include <cmath>

#include "color_histogram.hpp"
#include "gslts/detect/surface.hpp"

namespace gslts::detect {
namespace {

/// Of an object at least so much of its length is seen at both ends.
constexpr double kLeastLength = 0.2;

}  // namespace

std::array<double, 2> differences_of(const Surface& a, const Surface& b) {
  constexpr double kNone_m2 = 1e-6;
  const double log_ratio = std::log((a.area_m2 + kNone_m2) / (b.area_m2 + kNone_m2));
  return {distance(a.colors, b.colors), std::abs(log_ratio)};
}

double likeness(const Surface& a, const Surface& b) {
  const double one = (a.high - a.low).norm(), other = (b.high - b.low).norm();
  if (std::min(one, other) < kLeastLength * std::max(one, other)) return 0;
  // Found by benchmarks/fit_certainty.py.
  constexpr double kOffset = 7.146, kColors = -12.015, kArea = -0.489;
  const auto [colors, area] = differences_of(a, b);
  return 1 / (1 + std::exp(-(kOffset + kColors * colors + kArea * area)));
}

}  // namespace gslts::detect
