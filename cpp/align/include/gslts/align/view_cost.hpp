#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::align {

/// Read-only, non-owning view of an RGB-D picture.
template <typename T>
struct RgbdView {
  Camera camera;                       ///< Its intrinsics; its pose is not used.
  const T* photo = nullptr;            ///< [H,W,3] sRGB, 0 to 1
  const T* measured = nullptr;         ///< [H,W] z, m; 0 or NaN where there is no measurement.
  const std::uint8_t* mask = nullptr;  ///< [H,W] nonzero where pixels may count; null: all.
};

/// How much a picture and a map may differ.
struct CostRule {
  double color_scale = 0.08;     ///< Difference of a channel at which trust begins to end. > 0
  double depth_scale = 0.03;     ///< The same of the depth, as a share of it. > 0
  double depth_weight = 0.1;     ///< Of the depth, against the colours. >= 0
  double alpha_min = 0.9;        ///< Where less of the map is, it was never seen. (0, 1]
  raster::RenderOptions render;  ///< Of the map, with the number of threads.
};

/// How well a picture fits a map.
struct Fit {
  double known = 0;     ///< Share of the pixels that may count that the map fills.
  double alike = 0;     ///< Share of that where colours differ by less than `color_scale`,
  double measured = 0;  ///< where depth was measured,
  double near = 0;      ///< and share of this where it differs by less than `depth_scale`.
};

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A cost near a pose, by a twist xi = (rho, phi), m before rad, of world_from_camera * exp(xi).
struct Linearization {
  double cost = 0;
  Vector6 gradient = Vector6::Zero();   ///< Exact: the rasterizer's, by the rendering.
  Matrix6 curvature = Matrix6::Zero();  ///< Gauss-Newton, of direct image alignment.
};

/// What a picture says against having been taken at a pose.
///
/// The sum over the pixels that the map knows of rho(|e|^2 / 3 c^2) + w rho(d^2 / c_d^2), with e
/// the difference of the colours after a correction of the exposure, d that of the depths as a
/// share of the measured one, and rho(s) = s / (1 + s) / 2 (Geman and McClure 1985), under which
/// what changed since counts no more than what is slightly off. Which pixels the map knows and the
/// exposure are settled at the pose of construction, so that the cost is smooth.
template <typename T>
class ViewCost {
 public:
  /// @param gaussians, view  Must outlive this object.
  /// @param world_from_camera  Where to settle exposure and known pixels.
  /// @throws std::invalid_argument  if the camera, the pose or a setting is invalid.
  ViewCost(const GaussianView<T>& gaussians, const RgbdView<T>& view,
           const Eigen::Isometry3d& world_from_camera, const CostRule& rule = {});
  ~ViewCost();
  ViewCost(ViewCost&&) noexcept;
  ViewCost& operator=(ViewCost&&) noexcept;

  /// Pixels that count.
  std::size_t pixels() const;

  // Each renders only if the last call was of another pose.

  Fit fit(const Eigen::Isometry3d& world_from_camera);
  double at(const Eigen::Isometry3d& world_from_camera);
  Linearization linearized(const Eigen::Isometry3d& world_from_camera);
  Matrix6 curvature(const Eigen::Isometry3d& world_from_camera);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gslts::align
