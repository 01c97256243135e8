#include "gslts/optim/adam.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::optim {
namespace {

/// Gaussians that one task updates.
constexpr std::size_t kRowsPerTask = 2048;

std::size_t parameter_count(int sh_bases, int feature_dims) {
  return 11 + 3 * std::size_t(sh_bases) + std::size_t(feature_dims);
}

[[noreturn]] void fail(const std::string& what) { throw std::invalid_argument("Adam" + what); }

void validate(const AdamOptions& options) {
  const auto decays = [](double beta) { return beta >= 0 && beta < 1; };
  if (decays(options.beta1) && decays(options.beta2) && options.eps > 0) return;
  std::ostringstream message;
  message << ": beta1 and beta2 must be in [0, 1) and eps positive, got " << options.beta1 << ", "
          << options.beta2 << " and " << options.eps;
  fail(message.str());
}

/// @param name  Of the numbers in messages, after "Adam".
template <typename T>
void require_finite(const char* name, const T* values, std::size_t count) {
  T sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += values[i] * T(0);
  if (sum == 0) return;
  const T* bad =
      std::find_if_not(values, values + count, [](T value) { return std::isfinite(value); });
  std::ostringstream message;
  message << name << " has " << *bad << " at " << bad - values << ", must be finite";
  fail(message.str());
}

/// @param rule  Which numbers of the array `name` are good, in words and as a function.
template <typename T, typename Good>
void require_all(const Array<T>& values, const char* name, const std::string& rule, Good good) {
  const auto bad = std::find_if_not(values.begin(), values.end(), good);
  if (bad == values.end()) return;
  std::ostringstream message;
  message << ": " << name << " must " << rule << ", got " << *bad << " at " << bad - values.begin();
  fail(message.str());
}

template <typename T>
void require_state(const AdamState<T>& state) {
  const std::size_t size = state.steps.size() / kAdamGroups;
  const std::size_t numbers = size * parameter_count(state.sh_bases, state.feature_dims);
  std::ostringstream message;
  if (state.steps.size() % kAdamGroups != 0) {
    message << ": steps must hold " << kAdamGroups << " numbers a Gaussian, got "
            << state.steps.size();
    fail(message.str());
  }
  if (state.first.size() != numbers || state.second.size() != numbers) {
    message << ": " << size << " Gaussians need " << numbers << " first and second moments, got "
            << state.first.size() << " and " << state.second.size();
    fail(message.str());
  }
  require_finite(": first", state.first.data(), numbers);
  require_finite(": second", state.second.data(), numbers);
  require_all(state.second, "second", "not be negative", [](T value) { return value >= 0; });
  require_all(state.steps, "steps", "be at most " + std::to_string(kMaxAdamSteps),
              [](std::uint32_t steps) { return steps <= kMaxAdamSteps; });
}

/// Columns of a group of parameters with one learning rate.
template <typename T>
struct Group {
  T* values;
  const T* gradients;
  std::size_t stride;  ///< Row length of values and gradients.
  std::size_t first_moment, columns;
  T rate;
};

template <typename T>
using Groups = std::array<Group<T>, kAdamGroups>;

template <typename T>
Groups<T> groups_of(BasicGaussianMap<T>& map, const raster::GradientsView<T>& gradients,
                    const AdamRates& rates) {
  const std::size_t bases = std::size_t(map.sh_bases), dims = std::size_t(map.feature_dims);
  const std::size_t sh = 11, rest = 3 * bases - 3;
  return {{{map.means.data(), gradients.dL_dmeans, 3, 0, 3, T(rates.means)},
           {map.quats.data(), gradients.dL_dquats, 4, 3, 4, T(rates.quats)},
           {map.log_scales.data(), gradients.dL_dlog_scales, 3, 7, 3, T(rates.log_scales)},
           {map.logit_opacities.data(), gradients.dL_dlogit_opacities, 1, 10, 1,
            T(rates.logit_opacities)},
           {map.sh.data(), gradients.dL_dsh, 3 * bases, sh, 3, T(rates.sh_dc)},
           {map.sh.data() + 3, gradients.dL_dsh + 3, 3 * bases, sh + 3, rest, T(rates.sh_rest)},
           {map.features.data(), gradients.dL_dfeatures, dims, sh + 3 * bases, dims,
            T(rates.features)}}};
}

/// Checks that map and gradients have the layout of the state.
template <typename T>
void require_layout(const AdamState<T>& state, const BasicGaussianMap<T>& map,
                    const raster::GradientsView<T>& gradients) {
  std::ostringstream message;
  message << "::step: the state is of ";
  const std::size_t size = state.steps.size() / kAdamGroups;
  if (map.size() != size || map.sh_bases != state.sh_bases ||
      map.feature_dims != state.feature_dims) {
    message << size << " Gaussians with " << state.sh_bases << " SH bases and "
            << state.feature_dims << " features, map has " << map.size() << " with " << map.sh_bases
            << " and " << map.feature_dims;
    fail(message.str());
  }
  map.view();  // Checks the lengths of its arrays.
  if (gradients.sh_bases != state.sh_bases || gradients.feature_dims != state.feature_dims) {
    message << state.sh_bases << " SH bases and " << state.feature_dims
            << " features, gradients of " << gradients.sh_bases << " and "
            << gradients.feature_dims;
    fail(message.str());
  }
}

template <typename T>
void require_rows(const raster::GradientsView<T>& gradients, std::size_t size) {
  for (std::size_t i = 0; i < gradients.size; ++i) {
    const std::uint32_t row = gradients.rows[i];
    if (row < size && (i == 0 || gradients.rows[i - 1] < row)) continue;
    std::ostringstream message;
    message << "::step: rows must ascend and be below " << size << ", rows[" << i << "] is " << row;
    fail(message.str());
  }
}

void require_rates(const AdamRates& rates) {
  for (double rate : {rates.means, rates.quats, rates.log_scales, rates.logit_opacities,
                      rates.sh_dc, rates.sh_rest, rates.features}) {
    if (rate >= 0 && std::isfinite(rate)) continue;
    fail("::step: rates must not be negative, got " + std::to_string(rate));
  }
}

template <typename T>
void require_finite_gradients(const raster::GradientsView<T>& gradients) {
  const std::size_t n = gradients.size;
  require_finite("::step: dL_dmeans", gradients.dL_dmeans, 3 * n);
  require_finite("::step: dL_dquats", gradients.dL_dquats, 4 * n);
  require_finite("::step: dL_dlog_scales", gradients.dL_dlog_scales, 3 * n);
  require_finite("::step: dL_dlogit_opacities", gradients.dL_dlogit_opacities, n);
  require_finite("::step: dL_dsh", gradients.dL_dsh, 3 * std::size_t(gradients.sh_bases) * n);
  require_finite("::step: dL_dfeatures", gradients.dL_dfeatures,
                 std::size_t(gradients.feature_dims) * n);
}

}  // namespace

template <typename T>
Adam<T>::Adam(std::size_t size, int sh_bases, int feature_dims, const AdamOptions& options)
    : options_(options) {
  validate(options);
  // Checks both numbers.
  make_gaussian_map<T>(0, sh_bases, feature_dims);
  state_.sh_bases = sh_bases;
  state_.feature_dims = feature_dims;
  const std::size_t numbers = size * parameter_count(sh_bases, feature_dims);
  state_.first.assign(numbers, T(0));
  state_.second.assign(numbers, T(0));
  state_.steps.assign(size * kAdamGroups, 0);
}

template <typename T>
Adam<T>::Adam(AdamState<T> state, const AdamOptions& options)
    : options_(options), state_(std::move(state)) {
  validate(options);
  make_gaussian_map<T>(0, state_.sh_bases, state_.feature_dims);
  require_state(state_);
}

template <typename T>
void Adam<T>::extend_corrections(std::uint32_t steps) {
  for (std::size_t t = corrections_.size(); t <= steps; ++t) {
    corrections_.push_back({T(1 / (1 - power1_)), T(std::sqrt(1 / (1 - power2_)))});
    // By products, which are the same bits on every machine; std::pow is not.
    power1_ *= options_.beta1;
    power2_ *= options_.beta2;
  }
}

template <typename T>
void Adam<T>::step(BasicGaussianMap<T>& map, const raster::GradientsView<T>& gradients,
                   const AdamRates& rates, int threads) {
  require_layout(state_, map, gradients);
  require_rows(gradients, map.size());
  require_rates(rates);
  require_finite_gradients(gradients);

  const std::size_t visible = gradients.size;
  std::uint32_t max_steps = 0;
  for (std::size_t i = 0; i < visible; ++i) {
    const auto steps = state_.steps.begin() + gradients.rows[i] * kAdamGroups;
    max_steps = std::max(max_steps, *std::max_element(steps, steps + kAdamGroups));
  }
  extend_corrections(std::min(max_steps + 1, kMaxAdamSteps));
  const Groups<T> groups = groups_of(map, gradients, rates);
  const std::size_t parameters = parameter_count(state_.sh_bases, state_.feature_dims);
  const T beta1 = T(options_.beta1), beta2 = T(options_.beta2), eps = T(options_.eps);
  const std::size_t tasks = (visible + kRowsPerTask - 1) / kRowsPerTask;
  parallel::parallel_for(tasks, parallel::resolve_threads(threads), [&](std::size_t task) {
    const std::size_t end = std::min(visible, (task + 1) * kRowsPerTask);
    for (std::size_t i = task * kRowsPerTask; i < end; ++i) {
      const std::size_t row = gradients.rows[i];
      std::uint32_t* steps = state_.steps.data() + row * kAdamGroups;
      for (const Group<T>& group : groups) {
        std::uint32_t& step = *steps++;
        if (group.rate == 0) continue;
        step = std::min(step + 1, kMaxAdamSteps);
        const Correction unbiased = corrections_[step];
        T* first = state_.first.data() + row * parameters + group.first_moment;
        T* second = state_.second.data() + row * parameters + group.first_moment;
        T* value = group.values + row * group.stride;
        const T* gradient = group.gradients + i * group.stride;
        const T rate = group.rate * unbiased.first;
        for (std::size_t k = 0; k < group.columns; ++k) {
          const T g = gradient[k];
          first[k] = beta1 * first[k] + (1 - beta1) * g;
          // The square of a huge gradient must not stay infinite for good.
          second[k] =
              std::min(beta2 * second[k] + (1 - beta2) * g * g, std::numeric_limits<T>::max());
          value[k] -= rate * first[k] / (std::sqrt(second[k]) * unbiased.root_second + eps);
        }
      }
    }
  });
}

template <typename T>
Adam<T> Adam<T>::select(const std::vector<std::int64_t>& rows) const {
  Adam result(rows.size(), state_.sh_bases, state_.feature_dims, options_);
  const std::size_t parameters = parameter_count(state_.sh_bases, state_.feature_dims);
  const std::size_t size = state_.steps.size() / kAdamGroups;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i] == -1) continue;
    if (rows[i] < 0 || std::size_t(rows[i]) >= size) {
      std::ostringstream message;
      message << "::select: rows[" << i << "] is " << rows[i] << ", must be -1 or below " << size;
      fail(message.str());
    }
    const auto copy = [&, from = std::size_t(rows[i])](auto& array, auto& to, std::size_t columns) {
      std::copy_n(array.begin() + from * columns, columns, to.begin() + i * columns);
    };
    copy(state_.first, result.state_.first, parameters);
    copy(state_.second, result.state_.second, parameters);
    copy(state_.steps, result.state_.steps, kAdamGroups);
  }
  return result;
}

template class Adam<float>;
template class Adam<double>;

}  // namespace gslts::optim
