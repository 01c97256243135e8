#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace gslts::detect {

/// Returns the probability of a logistic regression, 0 to 1.
template <std::size_t N>
double logistic(double offset, const std::array<double, N>& weights,
                const std::array<double, N>& features) {
  double sum = offset;
  for (std::size_t k = 0; k < N; ++k) sum += weights[k] * features[k];
  return 1 / (1 + std::exp(-sum));
}

}  // namespace gslts::detect
