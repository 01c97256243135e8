#pragma once

#include <Eigen/Core>

#include "gslts/map/camera.hpp"
#include "gslts/optim/losses.hpp"

namespace gslts::align {

/// Normal equations H x = b of what a look at a rendering says about its camera.
///
/// x = (rho, phi, log fx, log fy, cx, cy): a twist of the pose, world_from_camera @ exp(rho, phi),
/// m before rad in the camera frame, and changes of the intrinsics, the last two in px.
struct NormalEquations {
  Eigen::Matrix<double, 10, 10> hessian = Eigen::Matrix<double, 10, 10>::Zero();
  Eigen::Matrix<double, 10, 1> right = Eigen::Matrix<double, 10, 1>::Zero();
};

/// What colours and depth each say. Colours tell about the camera that was rendered. Depth may come
/// from a lens of its own: it tells about the twist of that lens, whose intrinsics are trusted, so
/// that their columns are 0.
struct Alignment {
  NormalEquations color, depth;
};

/// One step of direct image alignment by Gauss-Newton (Kerl et al. 2013, Dense Visual SLAM for
/// RGB-D Cameras), linearised at the rendering, over means of 2 x 2 pixels. Differences of
/// brightness and of depth are weighted as by a Huber loss (0.02, and 1 % of the depth) and left
/// out where they are gross (0.25, and 5 %) or at edges of the depth.
///
/// @param camera  That was rendered.
/// @param rgb, depth  [H,W,3], [H,W] rendered, z in m.
/// @param photo, measured  The same as the sensor saw them; depth 0 where nothing was measured.
/// @param exposure  Applied to `rgb` first.
/// @throws std::invalid_argument  if the camera is invalid or the mask has another size.
template <typename T>
Alignment align(const Camera& camera, const T* rgb, const T* depth, const T* photo,
                const T* measured, const PixelMask& mask = {}, const optim::Exposure& exposure = {},
                int threads = 0);

}  // namespace gslts::align
