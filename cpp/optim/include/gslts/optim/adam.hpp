#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::optim {

/// Constants of Adam.
struct AdamOptions {
  double beta1 = 0.9;    ///< Decay of the first moment, in [0, 1).
  double beta2 = 0.999;  ///< Decay of the second moment, in [0, 1).
  double eps = 1e-15;    ///< > 0; 3DGS's value, as gradients of a mean over pixels are tiny.
};

/// Learning rates by group of parameters; a group with rate 0, its moments and its number of steps
/// stay unchanged.
struct AdamRates {
  double means = 0;
  double quats = 0;
  double log_scales = 0;
  double logit_opacities = 0;
  double sh_dc = 0;    ///< The three coefficients of degree 0.
  double sh_rest = 0;  ///< All other coefficients.
  double features = 0;
};

/// Groups of parameters, in the order of `AdamRates`.
constexpr std::size_t kAdamGroups = 7;

/// Maximum number of steps that is counted; more have no effect on the correction of the bias, for
/// a beta2 of up to 0.99999. It bounds the table of the corrections, to 16 MB.
constexpr std::uint32_t kMaxAdamSteps = 1 << 20;

/// State of Adam. A row holds the moments of a Gaussian's P = 11 + 3 K + D parameters:
/// mean, quaternion, log scales, logit opacity, SH, features.
template <typename T>
struct AdamState {
  int sh_bases = 1;            ///< K
  int feature_dims = 0;        ///< D
  Array<T> first, second;      ///< [N,P] running means of the gradients and of their squares
  Array<std::uint32_t> steps;  ///< [N,kAdamGroups] steps that each took part in, up to the maximum
};

/// Adam (Kingma & Ba 2015) over the parameters of a map.
///
/// A step touches only the Gaussians that have a gradient and the groups that have a rate, and
/// corrects the bias of their moments by the number of steps that each took part in: every group of
/// a Gaussian moves as if an Adam of its own had seen just those steps. With a gradient for all,
/// this is the usual Adam. Results are bit-identical for any thread count.
template <typename T>
class Adam {
 public:
  /// Starts for a map of `size` Gaussians.
  /// @throws std::invalid_argument  if a number is out of range.
  explicit Adam(std::size_t size, int sh_bases, int feature_dims = 0,
                const AdamOptions& options = {});
  /// Continues from a state, exactly.
  /// @throws std::invalid_argument  if the lengths of the arrays do not match, a moment is not
  ///   finite, a second one is negative, or a number of steps is above the maximum.
  explicit Adam(AdamState<T> state, const AdamOptions& options = {});

  const AdamState<T>& state() const { return state_; }

  /// Updates the Gaussians at gradients.rows.
  /// @throws std::invalid_argument  if map and gradients do not fit the state, the rows do not
  ///   ascend, a rate is negative or a gradient is not finite; then nothing has changed.
  void step(BasicGaussianMap<T>& map, const raster::GradientsView<T>& gradients,
            const AdamRates& rates, int threads = 0);

  /// Returns the state for a map whose Gaussian i was Gaussian rows[i], or is new if that is -1.
  /// @throws std::invalid_argument  if a row is out of range.
  Adam select(const std::vector<std::int64_t>& rows) const;

 private:
  /// Factors that correct the bias of the moments after a number of steps: 1 / (1 - beta1^t) and
  /// sqrt(1 / (1 - beta2^t)).
  struct Correction {
    T first, root_second;
  };
  void extend_corrections(std::uint32_t steps);

  AdamOptions options_;
  AdamState<T> state_;
  std::vector<Correction> corrections_;  ///< Indexed by the number of steps, from 0.
  double power1_ = 1, power2_ = 1;       ///< beta1^t and beta2^t for t = corrections_.size().
};

}  // namespace gslts::optim
