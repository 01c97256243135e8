#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_losses.hpp"

namespace gslts::raster::testing {

/// world_from_camera * exp(xi), xi = (rho, phi) along one axis of the six.
inline Camera moved_along(Camera camera, std::size_t axis, double amount) {
  const Eigen::Vector3d unit = Eigen::Vector3d::Unit(Eigen::Index(axis % 3));
  if (axis < 3) {
    camera.world_from_camera.translate(amount * unit);
  } else {
    camera.world_from_camera.rotate(Eigen::AngleAxisd(amount, unit));
  }
  return camera;
}

/// Tolerances of the comparison of analytic derivatives with finite differences.
struct FiniteDifferences {
  double step = 1e-4;
  double relative = 1e-6;  ///< Allowed error, of the entry itself ...
  double of_group = 1e-8;  ///< ... plus of the largest entry of its group.
  /// Entries near a jump or a kink of the loss, where its derivatives of second and fourth order
  /// differ by more than this share of the largest in the group, are skipped ...
  double kink = 1e-3;
  double skipped_share = 0;  ///< ... but no more than this share of all.
};

/// Derivative at 0 of order h^4, and whether the function looks smooth there.
struct Derivative {
  double value;
  double roughness;  ///< Difference to the derivative of order h^2.
};
template <typename Function>
Derivative differentiate(const Function& f, double h) {
  const double near = (f(h) - f(-h)) / (2 * h);
  const double far = (f(2 * h) - f(-2 * h)) / (4 * h);
  const double value = (4 * near - far) / 3;
  return {value, std::abs(value - near)};
}

/// Compares one group of derivatives.
inline void expect_derivatives(const std::string& name, const std::vector<double>& analytic,
                               const std::vector<Derivative>& numeric, const FiniteDifferences& fd,
                               std::size_t& skipped) {
  ASSERT_EQ(analytic.size(), numeric.size());
  double largest = 0;
  for (double value : analytic) largest = std::max(largest, std::abs(value));
  for (std::size_t i = 0; i < analytic.size(); ++i) {
    ASSERT_TRUE(std::isfinite(analytic[i])) << "dL_d" << name << " " << i;
    if (fd.skipped_share > 0 && numeric[i].roughness > fd.kink * largest) {
      ++skipped;
      continue;
    }
    EXPECT_NEAR(analytic[i], numeric[i].value,
                fd.relative * std::abs(analytic[i]) + fd.of_group * largest)
        << "dL_d" << name << " " << i;
  }
}

/// Checks the gradients of the loss with respect to all parameters and the pose, in double.
inline void expect_gradients(const BasicGaussianMap<double>& map, const Camera& camera,
                             const RenderOptions& options, const PixelMask& mask,
                             const LinearLoss<double>& loss, const FiniteDifferences& fd = {}) {
  Rasterizer<double> rasterizer;
  rasterizer.forward(map.view(), camera, options, mask);
  const Gradients<double> gradients = rasterizer.backward(map.view(), loss.gradients());
  const DenseGradients dense = dense_gradients(gradients, map);

  std::size_t skipped = 0, count = 6;
  BasicGaussianMap<double> changed = map;
  const auto groups = parameter_groups(changed);
  for (std::size_t group = 0; group < kGroups; ++group) {
    if (std::string(kGroupNames[group]) == "features" && !gradients.dL_dfeatures.size()) continue;
    std::vector<Derivative> numeric;
    for (double& parameter : *groups[group]) {
      const double start = parameter;
      numeric.push_back(differentiate(
          [&](double h) {
            parameter = start + h;
            return loss.value(rasterizer.forward(changed.view(), camera, options, mask));
          },
          fd.step));
      parameter = start;
    }
    expect_derivatives(kGroupNames[group], dense[group], numeric, fd, skipped);
    count += numeric.size();
  }

  std::vector<Derivative> numeric;
  for (std::size_t axis = 0; axis < 6; ++axis) {
    numeric.push_back(differentiate(
        [&](double h) {
          const Camera moved = moved_along(camera, axis, h);
          return loss.value(rasterizer.forward(map.view(), moved, options, mask));
        },
        fd.step));
  }
  expect_derivatives("twist", {gradients.dL_dtwist.begin(), gradients.dL_dtwist.end()}, numeric, fd,
                     skipped);
  EXPECT_LE(double(skipped), fd.skipped_share * double(count));
}

}  // namespace gslts::raster::testing
