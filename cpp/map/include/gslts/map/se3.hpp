#pragma once

#include <Eigen/Geometry>

namespace gslts {

/// A twist (rho, phi): translation (m) before rotation (rad), or a gradient with respect to one.
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// The matrix [a]x with [a]x b = a x b.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a);

/// The rotation about a vector by its length (Rodrigues' formula).
/// @param vector_rad  Axis times angle, rad.
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector_rad);

/// Right Jacobian of the rotation vector: rotation_from_vector(phi + d) =
/// rotation_from_vector(phi) * rotation_from_vector(J d) for small d.
/// Source: Sola et al. 2018, A micro Lie theory, eq. 143.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi_rad);

/// world_from_camera * (rotation(phi), rho): the exponential of the twist, of first order in the
/// translation.
/// @param twist  (rho, phi) in the camera frame, m before rad.
Eigen::Isometry3d se3_retract(const Eigen::Isometry3d& world_from_camera, const Vector6& twist);

/// Distance between two poses.
struct PoseDistance {
  double m, rad;
};
PoseDistance pose_distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b);

/// Returns true if a matrix is finite, orthonormal to 1e-6 and right-handed. The tolerance accepts
/// poses that were stored as float or multiplied many times.
bool is_rotation(const Eigen::Matrix3d& matrix);

}  // namespace gslts
