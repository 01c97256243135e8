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

/// Checks a camera; every public function that takes a camera calls it.
///
/// @param function  Name of the caller, for the message.
/// @throws std::invalid_argument  naming the field and its value: focal lengths not positive,
///   a size outside 1..65536, a rotation that is not orthonormal to 1e-6, or anything not finite.
void validate(const Camera& camera, const char* function);

/// Makes a camera with square pixels and the principal point at the image centre.
/// @param width, height  Image size, px.
/// @param horizontal_fov_rad  Horizontal field of view, rad, inside (0, pi).
/// @throws std::invalid_argument  if the field of view or the size is out of range.
Camera camera_from_fov(int width, int height, double horizontal_fov_rad,
                       const Eigen::Isometry3d& world_from_camera = Eigen::Isometry3d::Identity());

/// Derivative of the pixel (u, v) of a point with respect to the point: [2,3] px/m.
/// @param x_in_camera  Point in the camera frame, m, in front of the camera.
Eigen::Matrix<double, 2, 3> projection_jacobian(const Camera& camera,
                                                const Eigen::Vector3d& x_in_camera);

/// Crops the image of a camera to columns [x0, x1) and rows [y0, y1). It renders the same pixels,
/// but for Gaussians centred far outside: 3DGS projects those as if they were at 1.3 times the edge
/// of the view.
/// @throws std::invalid_argument  if the part is empty or not inside the image.
Camera cropped(const Camera& camera, int x0, int y0, int x1, int y1);

/// Computes the pose of a camera that looks at a point, its image upright.
/// @param eye, target  Camera centre and the point at the image centre, in the world, m.
/// @param up  Direction in the world, of any length.
/// @return  world_from_camera
/// @throws std::invalid_argument  if the target is the eye, or the view direction is along `up`.
Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target,
                          const Eigen::Vector3d& up = Eigen::Vector3d::UnitZ());

}  // namespace gslts
