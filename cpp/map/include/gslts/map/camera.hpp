#pragma once

#include <Eigen/Geometry>

namespace gslts {

/// A pinhole camera at a pose in the world.
///
/// Camera frame: OpenCV axes, x right, y down, z forward, metres. The pixel in column i and row j
/// covers [i, i+1) x [j, j+1) of the image plane; its centre is (i + 0.5, j + 0.5). A point
/// (x, y, z) in the camera frame is seen at (fx x/z + cx, fy y/z + cy) pixels.
struct Camera {
  double fx, fy;      ///< Focal lengths, px.
  double cx, cy;      ///< Principal point, px.
  int width, height;  ///< Image size, px.
  /// Rigid transform from the camera frame to the world frame: x_in_world = world_from_camera *
  /// x_in_camera. Metres, world z up.
  Eigen::Isometry3d world_from_camera;
};

/// Checks a camera; every public entry that takes one calls it.
///
/// @param function  Name of the caller, for the message.
/// @throws std::invalid_argument  naming the field and its value: focal lengths not positive,
///   a size outside 1..65536, a rotation that is not orthonormal to 1e-6, or anything not finite.
void validate(const Camera& camera, const char* function);

/// Camera with square pixels, the principal point at the image centre and the given horizontal
/// field of view (rad, inside (0, pi)).
/// @throws std::invalid_argument  if the field of view or the size is out of range.
Camera camera_from_fov(int width, int height, double horizontal_fov_rad,
                       const Eigen::Isometry3d& world_from_camera = Eigen::Isometry3d::Identity());

/// The same camera with a part of its image: columns [x0, x1) and rows [y0, y1). What it renders is
/// that part, but for Gaussians centred far outside it: 3DGS projects those as if they were at 1.3
/// times the edge of the view.
/// @throws std::invalid_argument  if the part is empty or not inside the image.
Camera cropped(const Camera& camera, int x0, int y0, int x1, int y1);

/// Pose of a camera at `eye` that looks at `target`, both in the world frame (m), image upright
/// with respect to `up`.
/// @throws std::invalid_argument  if the target is the eye, or the view direction is along `up`.
Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target,
                          const Eigen::Vector3d& up = Eigen::Vector3d::UnitZ());

}  // namespace gslts
