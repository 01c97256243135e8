#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>

#include "gslts/align/noise.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/map/se3.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::align {

/// Read-only, non-owning view of an RGB-D image.
template <typename T>
struct RgbdView {
  Camera camera;                       ///< Its intrinsics; its pose is not used.
  const T* photo = nullptr;            ///< [H,W,3] sRGB, 0 to 1
  const T* measured = nullptr;         ///< [H,W] z, m; 0 or NaN where there is no measurement.
  const std::uint8_t* mask = nullptr;  ///< [H,W] nonzero where pixels may count; null: all.
};

/// Settings of the cost of a view.
struct CostRule {
  /// Scale of the loss of a colour difference, and of a relative depth difference, beyond which
  /// errors lose influence. > 0
  double color_scale = kRobustColorStds * kGreyStd;
  double depth_scale = kRobustDepthStds * kDepthStd;
  double depth_weight = 0.1;     ///< Weight of depth against colour. >= 0
  double alpha_min = 0.9;        ///< Minimum alpha where the map is known. (0, 1]
  raster::RenderOptions render;  ///< Options of the rendering, with the number of threads.
};

/// Quality of the fit of an image to a map, in shares of pixels.
struct Fit {
  double known = 0;     ///< Share of the pixels that may count, at which the map is known.
  double alike = 0;     ///< Share of these whose colours differ by less than `color_scale`.
  double measured = 0;  ///< Share of the known pixels at which depth was measured.
  double near = 0;      ///< Share of these whose depth differs by less than `depth_scale`.
};

/// A cost near a pose, by a twist xi = (rho, phi), m before rad, of world_from_camera * exp(xi).
struct Linearization {
  double cost = 0;
  Vector6 gradient = Vector6::Zero();   ///< Exact: that of the rasterizer.
  Matrix6 curvature = Matrix6::Zero();  ///< Gauss-Newton, of direct image alignment.
};

/// Robust cost of a pose of an RGB-D image in a map, by rendering.
///
/// The sum over the known pixels of rho(|e|^2 / 3 c^2) + w rho(d^2 / c_d^2), with e the difference
/// of the colours after a correction of the exposure, d that of the depths relative to the measured
/// one, and rho(s) = s / (1 + s) / 2 (Geman and McClure 1985), so that changes since the mapping
/// have a bounded influence. The known pixels and the exposure are settled at the pose of
/// construction, so that the cost is smooth.
///
/// It shares noise model, surface Jacobian and equations with `align`, and differs in two respects.
/// Its gradient is exact, at the price of a backward pass: with Gauss-Newton's gradient the median
/// error of a pose was 7 % larger (4.5 instead of 4.2 mm, 30 views of a simulated kitchen). And its
/// loss is not convex, as views to localize may show changes.
template <typename T>
class ViewCost {
 public:
  /// @param gaussians, view  Must outlive this object.
  /// @param world_from_camera  Pose at which exposure and known pixels are settled.
  /// @throws std::invalid_argument  if the camera, the pose or a setting is invalid.
  ViewCost(const GaussianView<T>& gaussians, const RgbdView<T>& view,
           const Eigen::Isometry3d& world_from_camera, const CostRule& rule = {});
  ~ViewCost();
  ViewCost(ViewCost&&) noexcept;
  ViewCost& operator=(ViewCost&&) noexcept;

  /// Number of known pixels.
  std::size_t pixels() const;

  // The following render only if the last call was for another pose.

  /// Compares the image with the map at a pose.
  Fit fit(const Eigen::Isometry3d& world_from_camera);
  /// Computes the cost of a pose.
  double at(const Eigen::Isometry3d& world_from_camera);
  /// Computes cost, gradient and curvature.
  Linearization linearize(const Eigen::Isometry3d& world_from_camera);
  /// Computes the curvature.
  Matrix6 curvature(const Eigen::Isometry3d& world_from_camera);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gslts::align
