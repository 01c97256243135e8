#include "gslts/map/camera.hpp"

#include <cmath>
#include <sstream>

#include "gslts/map/require.hpp"
#include "gslts/map/se3.hpp"

namespace gslts {
namespace {

/// Maximum width and height of an image: their product fits into 32 bits.
constexpr int kMaxImageSize = 65536;

/// Sine of the smallest angle between the view direction and `up` that still defines a horizon.
constexpr double kMinHorizonSine = 1e-9;

/// C++17 has no std::numbers.
constexpr double kPi = 3.14159265358979323846;

/// Matrices in messages.
const Eigen::IOFormat kOneLine(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ", "", "",
                               "[", "]");

/// Prints as [1, 2, 3].
template <typename Derived>
auto one_line(const Eigen::MatrixBase<Derived>& matrix) {
  return matrix.format(kOneLine);
}

void require_positive(double value, const char* function, const char* what) {
  if (!(value > 0) || !std::isfinite(value)) fail(function, what, value);
}

void require_finite(double value, const char* function, const char* what) {
  if (!std::isfinite(value)) fail(function, what, value);
}

void require_finite(const Eigen::Vector3d& value, const char* function, const char* what) {
  if (!value.allFinite()) fail(function, what, one_line(value.transpose()));
}

void require_size(int value, const char* function, const char* what) {
  if (value < 1 || value > kMaxImageSize) fail(function, what, value);
}

}  // namespace

void validate(const Camera& camera, const char* function) {
  require_positive(camera.fx, function, "camera.fx must be positive and finite");
  require_positive(camera.fy, function, "camera.fy must be positive and finite");
  require_finite(camera.cx, function, "camera.cx must be finite");
  require_finite(camera.cy, function, "camera.cy must be finite");
  require_size(camera.width, function, "camera.width must be in 1..65536");
  require_size(camera.height, function, "camera.height must be in 1..65536");
  const Eigen::Matrix3d rotation = camera.world_from_camera.linear();
  if (!is_rotation(rotation)) {
    fail(function, "camera.world_from_camera must hold a rotation matrix", one_line(rotation));
  }
  require_finite(camera.world_from_camera.translation(), function,
                 "camera.world_from_camera must have a finite translation");
}

Camera camera_from_fov(int width, int height, double horizontal_fov_rad,
                       const Eigen::Isometry3d& world_from_camera) {
  constexpr const char* kFunction = "camera_from_fov";
  require_size(width, kFunction, "width must be in 1..65536");
  require_size(height, kFunction, "height must be in 1..65536");
  if (!(horizontal_fov_rad > 0 && horizontal_fov_rad < kPi)) {
    fail(kFunction, "horizontal_fov_rad must be inside (0, pi)", horizontal_fov_rad);
  }
  const double focal_px = 0.5 * width / std::tan(0.5 * horizontal_fov_rad);
  const Camera camera{focal_px, focal_px, 0.5 * width,      0.5 * height,
                      width,    height,   world_from_camera};
  validate(camera, kFunction);
  return camera;
}

Eigen::Matrix<double, 2, 3> projection_jacobian(const Camera& camera,
                                                const Eigen::Vector3d& x_in_camera) {
  const double z = x_in_camera.z();
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << camera.fx / z, 0, -camera.fx * x_in_camera.x() / (z * z),  //
      0, camera.fy / z, -camera.fy * x_in_camera.y() / (z * z);
  return jacobian;
}

Camera cropped(const Camera& camera, int x0, int y0, int x1, int y1) {
  validate(camera, "cropped");
  if (!(0 <= x0 && x0 < x1 && x1 <= camera.width && 0 <= y0 && y0 < y1 && y1 <= camera.height)) {
    std::ostringstream part;
    part << "columns " << x0 << " to " << x1 << " and rows " << y0 << " to " << y1;
    fail("cropped", "the part must lie in the image and must not be empty", part.str());
  }
  Camera result = camera;
  result.cx -= x0;
  result.cy -= y0;
  result.width = x1 - x0;
  result.height = y1 - y0;
  return result;
}

Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target,
                          const Eigen::Vector3d& up) {
  constexpr const char* kFunction = "look_at";
  require_finite(eye, kFunction, "eye must be finite");
  require_finite(target, kFunction, "target must be finite");
  require_finite(up, kFunction, "up must be finite");
  const Eigen::Vector3d forward = (target - eye).stableNormalized();
  if (forward.isZero(0))
    fail(kFunction, "target must differ from eye", one_line(target.transpose()));
  const Eigen::Vector3d right = forward.cross(up.stableNormalized());
  if (right.norm() < kMinHorizonSine) {
    fail(kFunction, "up must be nonzero and not along the view direction",
         one_line(up.transpose()));
  }
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear().col(0) = right.normalized();
  world_from_camera.linear().col(1) = forward.cross(right.normalized());
  world_from_camera.linear().col(2) = forward;
  world_from_camera.translation() = eye;
  return world_from_camera;
}

}  // namespace gslts
