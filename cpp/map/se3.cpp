#include "gslts/map/se3.hpp"

#include <Eigen/LU>
#include <cmath>

namespace gslts {
namespace {

/// Allowed error of an element of R^T R.
constexpr double kRotationTolerance = 1e-6;

}  // namespace

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return matrix;
}

Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector_rad) {
  const double angle = vector_rad.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector_rad / angle).toRotationMatrix();
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi_rad) {
  const double square = phi_rad.squaredNorm();
  const Eigen::Matrix3d cross = cross_matrix(phi_rad);
  if (square < 1e-12) return Eigen::Matrix3d::Identity() - cross / 2;
  const double angle = std::sqrt(square);
  return Eigen::Matrix3d::Identity() - (1 - std::cos(angle)) / square * cross +
         (angle - std::sin(angle)) / (square * angle) * cross * cross;
}

Eigen::Isometry3d se3_retract(const Eigen::Isometry3d& world_from_camera, const Vector6& twist) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translation() = twist.head<3>();
  motion.linear() = rotation_from_vector(twist.tail<3>());
  return world_from_camera * motion;
}

PoseDistance pose_distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d b_from_a = b.inverse() * a;
  return {b_from_a.translation().norm(), Eigen::AngleAxisd(b_from_a.linear()).angle()};
}

bool is_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::Matrix3d error = matrix.transpose() * matrix - Eigen::Matrix3d::Identity();
  // NaN fails the comparison, but passes Eigen's maximum.
  return matrix.allFinite() && error.cwiseAbs().maxCoeff() <= kRotationTolerance &&
         !(matrix.determinant() < 0);
}

}  // namespace gslts
