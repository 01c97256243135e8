#pragma once

#include <algorithm>
#include <cmath>

namespace gslts::align {

/// Weight of a residual by Huber's loss, over its standard deviation: 1 / std^2 within a standard
/// deviation, 1 / (std |r|) beyond; 0 for outliers. Convex: for mapping, whose frames show the map.
template <typename T>
T huber_weight(T residual, double std, double outlier) {
  const T size = std::abs(residual);
  return size < T(outlier) ? T(1 / std) / std::max(size, T(std)) : T(0);
}

/// Loss of a squared residual s, in units of its scale, by Geman and McClure 1985: s / (1 + s) / 2,
/// at most 1/2. For relocalization, in which large parts of a view may have changed.
template <typename T>
T geman_mcclure(T s) {
  return s / (1 + s) / 2;
}

/// Twice the derivative of `geman_mcclure`: the weight of a squared residual.
template <typename T>
T geman_mcclure_weight(T s) {
  return 1 / ((1 + s) * (1 + s));
}

}  // namespace gslts::align
