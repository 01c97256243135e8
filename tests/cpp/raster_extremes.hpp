#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "gslts/raster/rasterizer.hpp"
#include "raster_finite_differences.hpp"
#include "raster_losses.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster::testing {

/// Rendering of a degenerate scene, and its gradients.
template <typename T>
struct Survival {
  Images<T> images;
  Gradients<T> gradients;
};

template <typename Numbers>
bool all_finite(const Numbers& numbers) {
  for (const auto& value : numbers) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

/// Renders and differentiates, and expects finite numbers only, and alpha in [0, 1].
template <typename T>
Survival<T> expect_survival(const BasicGaussianMap<T>& map, const Camera& camera,
                            const RenderOptions& options = {}) {
  Rasterizer<T> rasterizer;
  Survival<T> result;
  result.images = rasterizer.forward(map.view(), camera, options);
  const auto loss = random_loss<T>(1, camera, map.feature_dims);
  result.gradients = rasterizer.backward(map.view(), loss.gradients(), true);
  const Images<T>& images = result.images;
  EXPECT_TRUE(all_finite(images.rgb));
  EXPECT_TRUE(all_finite(images.depth));
  EXPECT_TRUE(all_finite(images.alpha));
  EXPECT_TRUE(all_finite(images.features));
  for (T alpha : images.alpha) {
    EXPECT_GE(alpha, 0);
    EXPECT_LE(alpha, T(1.00001));
    if (::testing::Test::HasFailure()) break;
  }
  const Gradients<T>& gradients = result.gradients;
  EXPECT_TRUE(all_finite(gradients.dL_dmeans)) << "means";
  EXPECT_TRUE(all_finite(gradients.dL_dquats)) << "quats";
  EXPECT_TRUE(all_finite(gradients.dL_dlog_scales)) << "log_scales";
  EXPECT_TRUE(all_finite(gradients.dL_dlogit_opacities)) << "logit_opacities";
  EXPECT_TRUE(all_finite(gradients.dL_dsh)) << "sh";
  EXPECT_TRUE(all_finite(gradients.dL_dfeatures)) << "features";
  EXPECT_TRUE(all_finite(gradients.dL_dtwist)) << "twist";
  EXPECT_TRUE(all_finite(gradients.abs_dL_dmeans2d)) << "means2d";
  EXPECT_TRUE(all_finite(gradients.max_weights)) << "weights";
  return result;
}

/// Steps for the parameters of one Gaussian and the pose, small against what changes the image.
struct Steps {
  double means = 1e-5, quats = 1e-5, log_scales = 1e-5, logit_opacities = 1e-5, twist = 1e-5;
};

/// In double, compares the gradient of some Gaussians and the pose with finite differences; in
/// float, for which no difference is small enough, does nothing. Smooth only where alpha_min and
/// transmittance_min are all but zero.
template <typename T>
void expect_spot_derivatives(const BasicGaussianMap<T>& map, const Camera& camera,
                             const RenderOptions& options, const std::vector<std::size_t>& rows,
                             const Steps& steps = {}, double tolerance = 1e-4) {
  if constexpr (std::is_same_v<T, double>) {
    Rasterizer<double> rasterizer;
    const auto loss = random_loss<double>(1, camera, map.feature_dims);
    rasterizer.forward(map.view(), camera, options);
    const Gradients<double> gradients = rasterizer.backward(map.view(), loss.gradients());
    const auto dense = dense_gradients(gradients, map);
    BasicGaussianMap<double> changed = map;
    const auto groups = parameter_groups(changed);
    const double step_of[4] = {steps.means, steps.quats, steps.log_scales, steps.logit_opacities};
    const std::size_t columns[4] = {3, 4, 3, 1};
    for (std::size_t row : rows) {
      for (std::size_t group = 0; group < 4; ++group) {
        std::vector<double> analytic, numeric;
        for (std::size_t c = 0; c < columns[group]; ++c) {
          double& parameter = (*groups[group])[row * columns[group] + c];
          const double start = parameter;
          const Derivative derivative = differentiate(
              [&](double h) {
                parameter = start + h;
                return loss.value(rasterizer.forward(changed.view(), camera, options));
              },
              step_of[group]);
          parameter = start;
          analytic.push_back(dense[group][row * columns[group] + c]);
          numeric.push_back(derivative.value);
        }
        double largest = 0;
        for (double value : numeric) largest = std::max(largest, std::abs(value));
        for (std::size_t c = 0; c < columns[group]; ++c) {
          EXPECT_NEAR(analytic[c], numeric[c], tolerance * largest + 1e-12)
              << kGroupNames[group] << "[" << row << "," << c << "]";
        }
      }
    }
    std::vector<double> numeric;
    double largest = 0;
    for (std::size_t axis = 0; axis < 6; ++axis) {
      const Derivative derivative = differentiate(
          [&](double h) {
            return loss.value(
                rasterizer.forward(map.view(), moved_along(camera, axis, h), options));
          },
          steps.twist);
      numeric.push_back(derivative.value);
      largest = std::max(largest, std::abs(derivative.value));
    }
    for (std::size_t axis = 0; axis < 6; ++axis) {
      EXPECT_NEAR(gradients.dL_dtwist[axis], numeric[axis], tolerance * largest + 1e-12)
          << "twist[" << axis << "]";
    }
  }
}

/// Options without thresholds at which the image jumps.
inline RenderOptions without_jumps() {
  RenderOptions options;
  options.near_sigmas = 0;
  options.alpha_min = 1e-30;
  options.transmittance_min = 0;
  return options;
}

}  // namespace gslts::raster::testing
