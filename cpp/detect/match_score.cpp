#include <algorithm>
#include <cmath>

#include "color_histogram.hpp"
#include "constants.hpp"
#include "gslts/detect/surface.hpp"
#include "logistic.hpp"

namespace gslts::detect {

std::array<double, 2> match_features(const Surface& a, const Surface& b) {
  const double ratio = (a.high - a.low).z() + kTinyHeight_m,
               other = (b.high - b.low).z() + kTinyHeight_m;
  return {distance(a.color_histogram, b.color_histogram), std::abs(std::log(ratio / other))};
}

double match_score(const Surface& a, const Surface& b) {
  const auto [shorter, longer] = std::minmax({(a.high - a.low).norm(), (b.high - b.low).norm()});
  if (shorter < kMinLengthRatio * longer) return 0;
  return logistic(kMatchOffset, kMatchWeights, match_features(a, b));
}

}  // namespace gslts::detect
