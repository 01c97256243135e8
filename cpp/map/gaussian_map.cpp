#include "gslts/map/gaussian_map.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "gslts/map/require.hpp"

namespace gslts {
namespace {

bool is_sh_bases(int bases) { return bases == 1 || bases == 4 || bases == 9 || bases == 16; }

void require_layout(int sh_bases, int feature_dims, const char* function) {
  if (!is_sh_bases(sh_bases)) fail(function, "sh_bases must be 1, 4, 9 or 16", sh_bases);
  if (feature_dims < 0) fail(function, "feature_dims must not be negative", feature_dims);
}

/// Returns true if n numbers are all finite. Compilers vectorise the loop although they may not
/// reorder floating-point sums.
template <typename T>
bool all_finite(const T* values, std::size_t n) {
  constexpr std::size_t kLanes = 32;
  T sums[kLanes] = {};
  std::size_t i = 0;
  // x * 0 is 0 for finite x and NaN otherwise.
  for (; i + kLanes <= n; i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) sums[lane] += values[i + lane] * T(0);
  }
  for (std::size_t lane = 0; i < n; ++i, ++lane) sums[lane] += values[i] * T(0);
  return std::all_of(sums, sums + kLanes, [](T sum) { return sum == T(0); });
}

/// Throws if an element of the row-major array of the given shape is not finite.
template <typename T>
void require_finite(const T* values, std::initializer_list<std::size_t> shape, const char* array,
                    const char* function) {
  constexpr std::size_t kChunk = 4096;
  const std::size_t n =
      std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<std::size_t>());
  for (std::size_t begin = 0; begin < n; begin += kChunk) {
    const std::size_t end = std::min(n, begin + kChunk);
    if (all_finite(values + begin, end - begin)) continue;
    const T* bad =
        std::find_if(values + begin, values + end, [](T v) { return !std::isfinite(v); });
    std::ostringstream message;
    message << function << ": " << array << '[';
    std::size_t rest = std::size_t(bad - values), stride = n;
    const char* separator = "";
    for (std::size_t extent : shape) {
      stride /= extent;
      message << separator << rest / stride;
      rest %= stride;
      separator = ",";
    }
    message << "] is " << (std::isnan(*bad) ? "nan" : *bad > 0 ? "inf" : "-inf");
    throw std::invalid_argument(message.str());
  }
}

template <typename T>
void require_rows(const Array<T>& array, std::size_t rows, std::size_t columns, const char* name) {
  if (array.size() == rows * columns) return;
  std::ostringstream message;
  message << "BasicGaussianMap::view: " << name << " must hold " << rows << " x " << columns
          << " numbers, got " << array.size();
  throw std::invalid_argument(message.str());
}

}  // namespace

template <typename T>
GaussianView<T> BasicGaussianMap<T>::view() const {
  require_layout(sh_bases, feature_dims, "BasicGaussianMap::view");
  require_rows(means, size(), 3, "means");
  require_rows(quats, size(), 4, "quats");
  require_rows(log_scales, size(), 3, "log_scales");
  require_rows(sh, size(), std::size_t(sh_bases) * 3, "sh");
  require_rows(features, size(), std::size_t(feature_dims), "features");
  GaussianView<T> view;
  view.size = size();
  view.sh_bases = sh_bases;
  view.feature_dims = feature_dims;
  view.means = means.data();
  view.quats = quats.data();
  view.log_scales = log_scales.data();
  view.logit_opacities = logit_opacities.data();
  view.sh = sh.data();
  view.features = feature_dims > 0 ? features.data() : nullptr;
  view.origin = origin;
  return view;
}

template <typename T>
BasicGaussianMap<T> make_gaussian_map(std::size_t size, int sh_bases, int feature_dims,
                                      std::uint64_t first_id) {
  require_layout(sh_bases, feature_dims, "make_gaussian_map");
  BasicGaussianMap<T> map;
  map.sh_bases = sh_bases;
  map.feature_dims = feature_dims;
  map.means.resize(size * 3);
  map.quats.resize(size * 4);
  map.log_scales.resize(size * 3);
  map.logit_opacities.resize(size);
  map.sh.resize(size * std::size_t(sh_bases) * 3);
  map.features.resize(size * std::size_t(feature_dims));
  map.ids.resize(size);
  std::iota(map.ids.begin(), map.ids.end(), first_id);
  return map;
}

template <typename T>
BasicGaussianMap<T> select(const BasicGaussianMap<T>& map, const std::vector<std::uint32_t>& rows) {
  map.view();  // Checks the lengths of the other arrays.
  require_rows(map.ids, map.size(), 1, "ids");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i] < map.size()) continue;
    std::ostringstream message;
    message << "select: rows[" << i << "] is " << rows[i] << ", must be below " << map.size();
    throw std::invalid_argument(message.str());
  }
  auto result = make_gaussian_map<T>(rows.size(), map.sh_bases, map.feature_dims);
  result.origin = map.origin;
  const auto copy = [&](const auto& from, auto& to, std::size_t columns) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::copy_n(from.data() + rows[i] * columns, columns, to.data() + i * columns);
    }
  };
  copy(map.means, result.means, 3);
  copy(map.quats, result.quats, 4);
  copy(map.log_scales, result.log_scales, 3);
  copy(map.logit_opacities, result.logit_opacities, 1);
  copy(map.sh, result.sh, 3 * std::size_t(map.sh_bases));
  copy(map.features, result.features, std::size_t(map.feature_dims));
  copy(map.ids, result.ids, 1);
  return result;
}

template <typename T>
void validate(const GaussianView<T>& gaussians, const char* function) {
  require_layout(gaussians.sh_bases, gaussians.feature_dims, function);
  const auto require_pointer = [&](const T* pointer, const char* what) {
    if (!pointer) fail(function, what, "null");
  };
  if (gaussians.size > 0) {
    require_pointer(gaussians.means, "means must point to [N,3] numbers");
    require_pointer(gaussians.quats, "quats must point to [N,4] numbers");
    require_pointer(gaussians.log_scales, "log_scales must point to [N,3] numbers");
    require_pointer(gaussians.logit_opacities, "logit_opacities must point to [N] numbers");
    require_pointer(gaussians.sh, "sh must point to [N,K,3] numbers");
    if (gaussians.feature_dims > 0) {
      require_pointer(gaussians.features, "features must point to [N,D] numbers");
    }
  }
  if (gaussians.bounds && gaussians.bounds->size != gaussians.size) {
    fail(function, "bounds must be those of the Gaussians, got bounds of a map of size",
         gaussians.bounds->size);
  }
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(gaussians.origin(i))) {
      fail(function, "origin must be finite", gaussians.origin(i));
    }
  }
}

template <typename T>
void require_finite(const GaussianView<T>& gaussians, const char* function) {
  const std::size_t n = gaussians.size;
  const std::size_t bases = std::size_t(gaussians.sh_bases);
  const std::size_t dims = std::size_t(gaussians.feature_dims);
  require_finite(gaussians.means, {n, 3}, "means", function);
  require_finite(gaussians.quats, {n, 4}, "quats", function);
  require_finite(gaussians.log_scales, {n, 3}, "log_scales", function);
  require_finite(gaussians.logit_opacities, {n}, "logit_opacities", function);
  require_finite(gaussians.sh, {n, bases, 3}, "sh", function);
  require_finite(gaussians.features, {n, dims}, "features", function);
}

template struct BasicGaussianMap<float>;
template struct BasicGaussianMap<double>;
template BasicGaussianMap<float> make_gaussian_map(std::size_t, int, int, std::uint64_t);
template BasicGaussianMap<double> make_gaussian_map(std::size_t, int, int, std::uint64_t);
template BasicGaussianMap<float> select(const BasicGaussianMap<float>&,
                                        const std::vector<std::uint32_t>&);
template BasicGaussianMap<double> select(const BasicGaussianMap<double>&,
                                         const std::vector<std::uint32_t>&);
template void validate(const GaussianView<float>&, const char*);
template void validate(const GaussianView<double>&, const char*);
template void require_finite(const GaussianView<float>&, const char*);
template void require_finite(const GaussianView<double>&, const char*);

}  // namespace gslts
