#pragma once

#include <Eigen/Core>

#include "gslts/map/camera.hpp"
#include "gslts/optim/losses.hpp"

namespace gslts::align {

/// Normal equations H x = b of a step of the camera of a rendering.
///
/// x = (rho, phi, log fx, log fy, cx, cy): a twist of the pose, world_from_camera @ exp(rho, phi),
/// m before rad in the camera frame, and changes of the intrinsics, the last two in px.
struct NormalEquations {
  Eigen::Matrix<double, 10, 10> hessian = Eigen::Matrix<double, 10, 10>::Zero();
  Eigen::Matrix<double, 10, 1> right = Eigen::Matrix<double, 10, 1>::Zero();
};

/// The equations of colour and of depth. Colours constrain the camera that was rendered. Depth may
/// come from a lens of its own: it constrains the twist of that lens, whose intrinsics are trusted,
/// so that their columns are 0.
struct Alignment {
  NormalEquations color, depth;
};

/// Computes the normal equations of a Gauss-Newton step of direct image alignment (Kerl et al.
/// 2013, Dense Visual SLAM for RGB-D Cameras), linearised at the rendering, over means of 2 x 2
/// pixels, which have less noise. Differences of grey and of relative depth are weighted by Huber's
/// loss; outliers and edges of the depth are left out (noise.hpp).
///
/// @param camera  Camera of the rendering.
/// @param rgb, depth  [H,W,3], [H,W] rendered, z in m.
/// @param photo, measured  The same as observed; depth 0 where nothing was measured.
/// @param mask  Wanted pixels.
/// @param exposure  Applied to `rgb` first.
/// @param threads  0 means one per hardware thread; the result does not depend on it.
/// @throws std::invalid_argument  if the camera is invalid or the mask has another size.
template <typename T>
Alignment align(const Camera& camera, const T* rgb, const T* depth, const T* photo,
                const T* measured, const PixelMask& mask = {}, const optim::Exposure& exposure = {},
                int threads = 0);

}  // namespace gslts::align
