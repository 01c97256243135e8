#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// A camera of 64 x 48 px at `eye`.
inline Camera camera_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  return camera_from_fov(64, 48, 1.2, look_at(eye, target));
}

/// Gaussians with centres in the world; all other attributes differ from row to row.
inline GaussianMap map_of(const std::vector<Eigen::Vector3d>& centres,
                          const Eigen::Vector3d& origin = Eigen::Vector3d::Zero()) {
  GaussianMap map = make_gaussian_map<float>(centres.size(), 4, 2);
  map.origin = origin;
  const auto fill = [](Array<float>& array, float step) {
    for (std::size_t i = 0; i < array.size(); ++i) array[i] = step * float(i + 1);
  };
  fill(map.quats, 0.01f);
  fill(map.log_scales, -0.02f);
  fill(map.logit_opacities, 0.03f);
  fill(map.sh, 0.001f);
  fill(map.features, 0.5f);
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Eigen::Vector3d relative = centres[i] - origin;
    for (int k = 0; k < 3; ++k) map.means[3 * i + std::size_t(k)] = float(relative[k]);
  }
  return map;
}

/// Returns the message of what a function throws.
template <typename Function>
std::string message_of(Function function) {
  try {
    function();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace gslts::edit
