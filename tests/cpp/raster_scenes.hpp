#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::raster::testing {

constexpr double kPi = 3.14159265358979323846;

/// Random numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (double(engine_()) / 4294967296.0);
  }
  double normal() {
    const double u = 1 - uniform(0, 1);
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * uniform(0, 1));
  }
  Eigen::Vector4d quat() { return {normal(), normal(), normal(), normal()}; }

 private:
  std::mt19937 engine_;
};

/// Sets one Gaussian: zero SH and features but for the colour (0.5 + its SH of degree 0).
struct Gaussian {
  Eigen::Vector3d mean{0, 0, 2};
  Eigen::Vector4d quat_wxyz{1, 0, 0, 0};
  Eigen::Vector3d scale_m{0.1, 0.1, 0.1};
  double opacity = 0.5;
  Eigen::Vector3d color{1, 1, 1};
};

template <typename T>
BasicGaussianMap<T> map_of(const std::vector<Gaussian>& gaussians, int sh_bases = 1,
                           int feature_dims = 0) {
  constexpr double kSh0 = 0.28209479177387814;
  auto map = make_gaussian_map<T>(gaussians.size(), sh_bases, feature_dims);
  std::fill(map.sh.begin(), map.sh.end(), T(0));
  std::fill(map.features.begin(), map.features.end(), T(0));
  for (std::size_t n = 0; n < gaussians.size(); ++n) {
    const Gaussian& g = gaussians[n];
    for (int i = 0; i < 3; ++i) {
      map.means[3 * n + i] = T(g.mean[i]);
      map.log_scales[3 * n + i] = T(std::log(g.scale_m[i]));
      map.sh[3 * n * std::size_t(sh_bases) + i] = T((g.color[i] - 0.5) / kSh0);
    }
    for (int i = 0; i < 4; ++i) map.quats[4 * n + i] = T(g.quat_wxyz[i]);
    map.logit_opacities[n] = T(std::log(g.opacity / (1 - g.opacity)));
  }
  return map;
}

template <typename To, typename From>
BasicGaussianMap<To> converted(const BasicGaussianMap<From>& map) {
  auto result = make_gaussian_map<To>(map.size(), map.sh_bases, map.feature_dims);
  const auto copy = [](const Array<From>& from, Array<To>& to) {
    for (std::size_t i = 0; i < from.size(); ++i) to[i] = To(from[i]);
  };
  copy(map.means, result.means);
  copy(map.quats, result.quats);
  copy(map.log_scales, result.log_scales);
  copy(map.logit_opacities, result.logit_opacities);
  copy(map.sh, result.sh);
  copy(map.features, result.features);
  result.origin = map.origin;
  return result;
}

/// A camera that is in no way special: tilted, with the given size and 80 degrees of view.
inline Camera tilted_camera(int width, int height) {
  Eigen::Isometry3d pose = look_at({1.2, -0.7, 1.4}, {3.1, 2.2, 0.4});
  pose.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  return camera_from_fov(width, height, 80 * kPi / 180, pose);
}

/// A camera at the world's origin, x right, y down, z forward.
inline Camera straight_camera(int width, int height, double focal_px) {
  return {
      focal_px, focal_px, 0.5 * width, 0.5 * height, width, height, Eigen::Isometry3d::Identity()};
}

/// The options with which float is as precise as it can be.
inline RenderOptions precise_options() {
  RenderOptions options;
  options.exp_degree = 5;
  return options;
}

struct SceneShape {
  std::size_t gaussians = 300;
  int sh_bases = 16;
  int feature_dims = 0;
  double min_scale_px = 0.3, max_scale_px = 12;  ///< Spread of the axes as seen in the image.
  double min_depth_m = 0.4, max_depth_m = 6;
  double min_logit = -4, max_logit = 5;
  double outside = 0.2;  ///< Margin around the image for centres, as a share of its size.
  double behind = 0.1;   ///< Share of Gaussians behind the camera.
};

/// Gaussians in and around the camera's view, in random order, some behind it. All numbers are
/// floats, so that a float copy is the same map.
inline BasicGaussianMap<double> random_scene(std::uint32_t seed, const Camera& camera,
                                             const SceneShape& shape) {
  Random random(seed);
  auto map = make_gaussian_map<float>(shape.gaussians, shape.sh_bases, shape.feature_dims);
  for (std::size_t n = 0; n < shape.gaussians; ++n) {
    const double z = random.uniform(shape.min_depth_m, shape.max_depth_m);
    const double column = random.uniform(-shape.outside, 1 + shape.outside) * camera.width;
    const double row = random.uniform(-shape.outside, 1 + shape.outside) * camera.height;
    const bool behind = random.uniform(0, 1) < shape.behind;
    const Eigen::Vector3d in_camera((column - camera.cx) / camera.fx * z,
                                    (row - camera.cy) / camera.fy * z, behind ? -z : z);
    const Eigen::Vector3d in_world = camera.world_from_camera * in_camera;
    for (int i = 0; i < 3; ++i) {
      map.means[3 * n + i] = float(in_world[i]);
      const double log_px =
          random.uniform(std::log(shape.min_scale_px), std::log(shape.max_scale_px));
      map.log_scales[3 * n + i] = float(log_px + std::log(z / camera.fx));
    }
    const Eigen::Vector4d quat = random.quat();
    for (int i = 0; i < 4; ++i) map.quats[4 * n + i] = float(quat[i]);
    map.logit_opacities[n] = float(random.uniform(shape.min_logit, shape.max_logit));
  }
  for (float& value : map.sh) value = float(0.4 * random.normal());
  for (float& value : map.features) value = float(random.normal());
  return converted<double>(map);
}

/// A random mask with about the given share of wanted pixels.
inline std::vector<std::uint8_t> random_mask(std::uint32_t seed, const Camera& camera,
                                             double share) {
  Random random(seed);
  std::vector<std::uint8_t> mask(std::size_t(camera.width) * std::size_t(camera.height));
  for (std::uint8_t& wanted : mask) wanted = random.uniform(0, 1) < share;
  return mask;
}

inline PixelMask view_of(const std::vector<std::uint8_t>& mask, const Camera& camera) {
  return {mask.data(), camera.width, camera.height};
}

}  // namespace gslts::raster::testing
