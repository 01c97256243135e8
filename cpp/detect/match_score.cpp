#include <algorithm>
#include <cmath>

#include "color_histogram.hpp"
#include "constants.hpp"
#include "gslts/detect/surface.hpp"
#include "logistic.hpp"

namespace gslts::detect {

std::array<double, 2> match_features(const Surface& before, const Surface& after) {
  const double was_m = (before.high - before.low).z() + kTinyHeight_m;
  const double is_m = (after.high - after.low).z() + kTinyHeight_m;
  return {distance(before.color_histogram, after.color_histogram),
          std::max(0.0, std::log(is_m / was_m))};
}

double match_score(const Surface& before, const Surface& after) {
  const double was_m = (before.high - before.low).norm(), is_m = (after.high - after.low).norm();
  const auto [shorter, longer] = std::minmax(was_m, is_m);
  if (shorter < kMinLengthRatio * longer) return 0;
  return logistic(kMatchOffset, kMatchWeights, match_features(before, after));
}

}  // namespace gslts::detect
