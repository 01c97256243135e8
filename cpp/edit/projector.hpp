#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// A projected point.
struct Pixel {
  std::size_t index;  ///< Row by row.
  double depth_m;     ///< z of the point in the camera frame.
};

/// Projects centres of Gaussians into one image: pi(T_k mu_i) of GS-LTS, eq. 11.
class Projector {
 public:
  Projector(const Camera& camera, const Eigen::Vector3d& origin)
      : camera_(camera), camera_from_world_(camera.world_from_camera.inverse()), origin_(origin) {}

  /// @param mean  Relative to the origin, m.
  /// @return  Nothing behind the camera or outside the image.
  std::optional<Pixel> operator()(const float* mean) const {
    const Eigen::Vector3d in_world =
        origin_ + Eigen::Vector3d(double(mean[0]), double(mean[1]), double(mean[2]));
    const Eigen::Vector3d p = camera_from_world_ * in_world;
    if (!(p.z() > 0)) return std::nullopt;
    const double column = std::floor(camera_.fx * p.x() / p.z() + camera_.cx);
    const double row = std::floor(camera_.fy * p.y() / p.z() + camera_.cy);
    // NaN fails the comparisons too.
    if (!(column >= 0 && row >= 0 && column < camera_.width && row < camera_.height)) {
      return std::nullopt;
    }
    return Pixel{std::size_t(row) * std::size_t(camera_.width) + std::size_t(column), p.z()};
  }

 private:
  Camera camera_;
  Eigen::Isometry3d camera_from_world_;
  Eigen::Vector3d origin_;
};

/// Calls visit(i, pixel) for every Gaussian whose centre is in the image.
template <typename Visit>
void for_each_projection(const GaussianView<float>& gaussians, const Camera& camera, Visit visit) {
  const Projector project(camera, gaussians.origin);
  for (std::size_t i = 0; i < gaussians.size; ++i) {
    if (const auto pixel = project(gaussians.means + 3 * i)) visit(i, *pixel);
  }
}

/// @throws std::invalid_argument  if a number is negative or not finite.
inline void require_margin(const char* function, const char* name, double value) {
  if (value >= 0 && std::isfinite(value)) return;
  std::ostringstream message;
  message << function << ": " << name << " must be finite and not negative, got " << value;
  throw std::invalid_argument(message.str());
}

}  // namespace gslts::edit
