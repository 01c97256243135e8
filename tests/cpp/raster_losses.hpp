#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster::testing {

/// The images that a loss compares.
struct Outputs {
  bool rgb = false, depth = false, alpha = false, features = false;
};
constexpr Outputs kAllOutputs{true, true, true, true};

/// A loss that weighs every number of the images it compares.
template <typename T>
struct LinearLoss {
  Array<T> rgb, depth, alpha, features;  ///< Weights; empty where the loss ignores the image.

  double value(const Images<T>& images) const {
    long double sum = 0;
    const auto add = [&sum](const Array<T>& weights, const Array<T>& image) {
      for (std::size_t i = 0; i < weights.size(); ++i) {
        sum += static_cast<long double>(weights[i]) * static_cast<long double>(image[i]);
      }
    };
    add(rgb, images.rgb);
    add(depth, images.depth);
    add(alpha, images.alpha);
    add(features, images.features);
    return double(sum);
  }

  ImageGradients<T> gradients() const {
    const auto pointer = [](const Array<T>& a) { return a.empty() ? nullptr : a.data(); };
    return {pointer(rgb), pointer(depth), pointer(alpha), pointer(features)};
  }
};

/// Normally distributed weights, the same numbers for every T.
template <typename T>
LinearLoss<T> random_loss(std::uint32_t seed, const Camera& camera, int feature_dims,
                          const Outputs& outputs = kAllOutputs) {
  Random random(seed);
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  const auto fill = [&random](Array<T>& weights, std::size_t size, bool used) {
    if (!used) return;
    weights.resize(size);
    for (T& weight : weights) weight = T(float(random.normal()));
  };
  LinearLoss<T> loss;
  fill(loss.rgb, 3 * pixels, outputs.rgb);
  fill(loss.depth, pixels, outputs.depth);
  fill(loss.alpha, pixels, outputs.alpha);
  fill(loss.features, pixels * std::size_t(feature_dims), outputs.features);
  return loss;
}

constexpr std::size_t kGroups = 6;
constexpr std::array<const char*, kGroups> kGroupNames = {"means",           "quats", "log_scales",
                                                          "logit_opacities", "sh",    "features"};

template <typename T>
std::array<Array<T>*, kGroups> parameter_groups(BasicGaussianMap<T>& map) {
  return {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh, &map.features};
}

/// Gradients for all N Gaussians, in the layout of the map; zero for those not seen.
using DenseGradients = std::array<std::vector<double>, kGroups>;

template <typename T>
DenseGradients dense_gradients(const Gradients<T>& gradients, const BasicGaussianMap<T>& map) {
  const std::array<const Array<T>*, kGroups> sparse = {
      &gradients.dL_dmeans,           &gradients.dL_dquats, &gradients.dL_dlog_scales,
      &gradients.dL_dlogit_opacities, &gradients.dL_dsh,    &gradients.dL_dfeatures};
  const std::array<std::size_t, kGroups> columns = {
      3, 4, 3, 1, std::size_t(map.sh_bases) * 3, std::size_t(map.feature_dims)};
  DenseGradients dense;
  for (std::size_t group = 0; group < kGroups; ++group) {
    dense[group].assign(map.size() * columns[group], 0.0);
    for (std::size_t v = 0; v < gradients.rows.size(); ++v) {
      for (std::size_t c = 0; c < columns[group]; ++c) {
        dense[group][gradients.rows[v] * columns[group] + c] =
            double((*sparse[group])[v * columns[group] + c]);
      }
    }
  }
  return dense;
}

}  // namespace gslts::raster::testing
