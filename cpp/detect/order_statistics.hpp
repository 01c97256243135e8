#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace gslts::detect {

/// Returns the k-th smallest of some values (from 0), which are reordered.
template <typename T>
T nth_smallest(std::vector<T>& values, std::size_t k) {
  const auto nth = values.begin() + std::ptrdiff_t(k);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Returns the median of at least one value: of an even number the greater of the two in the
/// middle.
template <typename T>
T median(std::vector<T> values) {
  return nth_smallest(values, values.size() / 2);
}

/// Returns the quantile of at least one value, which are reordered: that below which at least
/// `share` of the others lie. With 0.5 it is the median, the smaller of the two in the middle.
template <typename T>
T quantile(std::vector<T>& values, double share) {
  return nth_smallest(values, std::size_t(share * double(values.size() - 1)));
}

}  // namespace gslts::detect
