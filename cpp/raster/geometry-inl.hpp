// Projection of 3D Gaussians to 2D, one Gaussian a lane, shared by the forward and the backward
// pass: EWA splatting (Zwicker et al. 2002) as in 3DGS (Kerbl et al. 2023, sec. 4). Included once
// per instruction set.

#if defined(GSLTS_RASTER_GEOMETRY_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_GEOMETRY_INL_HPP
#undef GSLTS_RASTER_GEOMETRY_INL_HPP
#else
#define GSLTS_RASTER_GEOMETRY_INL_HPP
#endif

#include "gslts/map/gaussian_map.hpp"
#include "rows-inl.hpp"
#include "setup.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// A projected Gaussian. W is the rotation camera_from_map, R and S the Gaussian's rotation and
/// scales, J the Jacobian of the projection to pixels.
template <class D>
struct Geometry {
  using V = hn::Vec<D>;
  V x, y, z, inverse_z;  ///< Centre in the camera frame, m.
  V x_over_z, y_over_z;
  V tan_x, tan_y;                ///< The same, clamped: where J is evaluated.
  V focal_x, focal_y;            ///< f / z, px/m
  V quat[4], inverse_norm;       ///< Unit quaternion; 1 / norm of the stored one, 0 if it had none.
  V camera_from_gaussian[3][3];  ///< W R
  V scale[3];                    ///< m
  hn::Mask<D> scale_free[3];     ///< Scale not clamped.
  V jacobian[2][3];              ///< J W R, px/m
  V axes[2][3];                  ///< J W R S, px: the Gaussian's axes in the image.
  /// With s = min(1, 1 / longest axis), so that nothing overflows: s, and s^2 times the projected
  /// covariance and s^4 times its determinant, before and after adding eps2d.
  V shrink;
  V cov_xx, cov_xy, cov_yy, det;
  V low_pass;  ///< s^2 eps2d
  V filtered_xx, filtered_yy, filtered_det;
};

/// Transforms means from the map to the camera frame.
template <class D, typename T>
HWY_INLINE void to_camera(D d, const RenderSetup<T>& setup, const hn::Vec<D>* mean,
                          hn::Vec<D>* out) {
  for (int i = 0; i < 3; ++i) {
    auto sum = hn::Set(d, setup.map_origin_in_camera[i]);
    for (int j = 0; j < 3; ++j) {
      sum = hn::MulAdd(hn::Set(d, setup.camera_from_map[i][j]), mean[j], sum);
    }
    out[i] = sum;
  }
}

/// Projects the centre, and clamps the point at which the Jacobian is evaluated.
template <class D, typename T, typename Row>
HWY_INLINE void project_center(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                               const Row* rows, Geometry<D>& g) {
  hn::Vec<D> mean[3], center[3];
  gather_rows<3>(d, gaussians.means, gaussians.means + 3 * gaussians.size, 3, rows, mean);
  to_camera(d, setup, mean, center);
  g.x = center[0];
  g.y = center[1];
  g.z = center[2];
  g.inverse_z = hn::Div(hn::Set(d, T(1)), g.z);
  g.x_over_z = hn::Mul(g.x, g.inverse_z);
  g.y_over_z = hn::Mul(g.y, g.inverse_z);
  g.tan_x = hn::Clamp(g.x_over_z, hn::Set(d, setup.min_tan_x), hn::Set(d, setup.max_tan_x));
  g.tan_y = hn::Clamp(g.y_over_z, hn::Set(d, setup.min_tan_y), hn::Set(d, setup.max_tan_y));
  g.focal_x = hn::Mul(hn::Set(d, setup.fx), g.inverse_z);
  g.focal_y = hn::Mul(hn::Set(d, setup.fy), g.inverse_z);
}

/// Normalizes the quaternions; one that is too short becomes the identity.
template <class D, typename T>
HWY_INLINE void normalize_quats(D d, Geometry<D>& g) {
  // Divide by the largest component first: the squares of 1e20 or 1e-30 leave float's range.
  auto largest = hn::Set(d, T(kTiny));
  for (int i = 0; i < 4; ++i) largest = hn::Max(largest, hn::Abs(g.quat[i]));
  const auto one = hn::Set(d, T(1));
  const auto inverse_largest = hn::Div(one, largest);
  auto norm2 = hn::Zero(d);
  for (int i = 0; i < 4; ++i) {
    g.quat[i] = hn::Mul(g.quat[i], inverse_largest);
    norm2 = hn::MulAdd(g.quat[i], g.quat[i], norm2);
  }
  const auto rotates = hn::Ge(hn::Mul(largest, hn::Sqrt(norm2)), hn::Set(d, T(kMinQuatNorm)));
  const auto inverse = hn::Div(one, hn::Sqrt(hn::IfThenElse(rotates, norm2, one)));
  for (int i = 0; i < 4; ++i) {
    g.quat[i] = hn::IfThenElse(rotates, hn::Mul(g.quat[i], inverse), i == 0 ? one : hn::Zero(d));
  }
  g.inverse_norm = hn::IfThenElseZero(rotates, hn::Mul(inverse, inverse_largest));
}

/// Computes W R from the quaternions.
template <class D, typename T, typename Row>
HWY_INLINE void rotate_to_camera(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                                 const Row* rows, Geometry<D>& g) {
  using V = hn::Vec<D>;
  gather_rows<4>(d, gaussians.quats, gaussians.quats + 4 * gaussians.size, 4, rows, g.quat);
  normalize_quats<D, T>(d, g);
  const V one = hn::Set(d, T(1)), two = hn::Set(d, T(2));
  const V w = g.quat[0], x = g.quat[1], y = g.quat[2], z = g.quat[3];
  const V rotation[3][3] = {
      {hn::NegMulAdd(two, hn::MulAdd(y, y, hn::Mul(z, z)), one),
       hn::Mul(two, hn::MulSub(x, y, hn::Mul(w, z))),
       hn::Mul(two, hn::MulAdd(x, z, hn::Mul(w, y)))},
      {hn::Mul(two, hn::MulAdd(x, y, hn::Mul(w, z))),
       hn::NegMulAdd(two, hn::MulAdd(x, x, hn::Mul(z, z)), one),
       hn::Mul(two, hn::MulSub(y, z, hn::Mul(w, x)))},
      {hn::Mul(two, hn::MulSub(x, z, hn::Mul(w, y))), hn::Mul(two, hn::MulAdd(y, z, hn::Mul(w, x))),
       hn::NegMulAdd(two, hn::MulAdd(x, x, hn::Mul(y, y)), one)}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      V sum = hn::Mul(hn::Set(d, setup.camera_from_map[i][0]), rotation[0][j]);
      sum = hn::MulAdd(hn::Set(d, setup.camera_from_map[i][1]), rotation[1][j], sum);
      g.camera_from_gaussian[i][j] =
          hn::MulAdd(hn::Set(d, setup.camera_from_map[i][2]), rotation[2][j], sum);
    }
  }
}

/// Computes S = exp(log_scales), clamped.
template <class D, typename T, typename Row>
HWY_INLINE void activate_scales(D d, const GaussianView<T>& gaussians, const Row* rows,
                                Geometry<D>& g) {
  hn::Vec<D> log_scale[3];
  gather_rows<3>(d, gaussians.log_scales, gaussians.log_scales + 3 * gaussians.size, 3, rows,
                 log_scale);
  const auto max_log_scale = hn::Set(d, T(kMaxLogScale));
  for (int k = 0; k < 3; ++k) {
    g.scale_free[k] = hn::Lt(log_scale[k], max_log_scale);
    g.scale[k] = hn::Exp(d, hn::Min(log_scale[k], max_log_scale));
  }
}

/// Computes J W R S with the local affine approximation of the projection (Zwicker et al. 2002),
/// J = [f_x / z, 0, -f_x x / z^2; 0, f_y / z, -f_y y / z^2], and from it `shrink`.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void project_axes(D d, Geometry<D>& g) {
  auto longest = hn::Set(d, T(1));
  for (int k = 0; k < 3; ++k) {
    const auto depth_axis = g.camera_from_gaussian[2][k];
    g.jacobian[0][k] =
        hn::Mul(g.focal_x, hn::NegMulAdd(g.tan_x, depth_axis, g.camera_from_gaussian[0][k]));
    g.jacobian[1][k] =
        hn::Mul(g.focal_y, hn::NegMulAdd(g.tan_y, depth_axis, g.camera_from_gaussian[1][k]));
    g.axes[0][k] = hn::Mul(g.jacobian[0][k], g.scale[k]);
    g.axes[1][k] = hn::Mul(g.jacobian[1][k], g.scale[k]);
    longest = hn::Max(longest, hn::Max(hn::Abs(g.axes[0][k]), hn::Abs(g.axes[1][k])));
  }
  g.shrink = hn::Div(hn::Set(d, T(1)), longest);
}

/// Computes the projected covariance Sigma' = J W Sigma W^T J^T = (J W R S)(J W R S)^T (Kerbl et
/// al. 2023, eq. 5 and 6), and Sigma' + eps2d I.
template <class D, typename T>
HWY_INLINE void project_covariance(D d, const RenderSetup<T>& setup, Geometry<D>& g) {
  using V = hn::Vec<D>;
  V a[3], b[3], scale[3];
  for (int k = 0; k < 3; ++k) {
    a[k] = hn::Mul(g.axes[0][k], g.shrink);
    b[k] = hn::Mul(g.axes[1][k], g.shrink);
    scale[k] = hn::Mul(g.scale[k], g.shrink);
  }
  g.cov_xx = dot3<D>(a, a);
  g.cov_xy = dot3<D>(a, b);
  g.cov_yy = dot3<D>(b, b);
  // det(U U^T) is the squared length of the cross product of U's rows, and those of J W R have the
  // cross product (fx fy / z^2) (W R)^T (tan_x, tan_y, 1): no cancellation, however thin the
  // needle.
  const V focal2 = hn::Mul(g.focal_x, g.focal_y);
  g.det = hn::Zero(d);
  for (int k = 0; k < 3; ++k) {
    const V cross =
        hn::MulAdd(g.tan_x, g.camera_from_gaussian[0][k],
                   hn::MulAdd(g.tan_y, g.camera_from_gaussian[1][k], g.camera_from_gaussian[2][k]));
    const V area = hn::Mul(hn::Mul(hn::Mul(focal2, cross), scale[(k + 1) % 3]), scale[(k + 2) % 3]);
    g.det = hn::MulAdd(area, area, g.det);
  }
  g.low_pass = hn::Mul(hn::Mul(g.shrink, g.shrink), hn::Set(d, setup.eps2d_px2));
  g.filtered_xx = hn::Add(g.cov_xx, g.low_pass);
  g.filtered_yy = hn::Add(g.cov_yy, g.low_pass);
  // det(C + e I) = det(C) + e tr(C) + e^2
  g.filtered_det = hn::MulAdd(g.low_pass, hn::Add(hn::Add(g.cov_xx, g.cov_yy), g.low_pass), g.det);
}

/// Projects one Gaussian a lane, row rows[lane] of the arrays.
template <class D, typename T, typename Row>
HWY_INLINE Geometry<D> project(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                               const Row* rows) {
  Geometry<D> g;
  project_center(d, gaussians, setup, rows, g);
  rotate_to_camera(d, gaussians, setup, rows, g);
  activate_scales(d, gaussians, rows, g);
  project_axes(d, g);
  project_covariance(d, setup, g);
  return g;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
