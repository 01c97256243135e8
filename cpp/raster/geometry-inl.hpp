// The projection of a Gaussian (EWA splatting, Zwicker et al. 2001, as in 3DGS), one Gaussian a
// lane, shared by the forward and the backward pass. Included once per instruction set.

#if defined(GSLTS_RASTER_GEOMETRY_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_GEOMETRY_INL_HPP
#undef GSLTS_RASTER_GEOMETRY_INL_HPP
#else
#define GSLTS_RASTER_GEOMETRY_INL_HPP
#endif

#include "gslts/map/gaussian_map.hpp"
#include "setup.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// kColumns columns, from that of `base` on, of the rows rows[lane], which must ascend, of a
/// row-major array with rows `stride` numbers apart that ends at `end`. Loads and shuffles beat the
/// gather instructions of Zen 5, and NEON has none.
template <int kColumns, class D, typename T = hn::TFromD<D>, typename Row>
HWY_INLINE void gather_rows(D d, const T* base, const T* end, std::size_t stride, const Row* rows,
                            hn::Vec<D>* columns) {
  const std::size_t lanes = hn::Lanes(d);
  const auto row_of = [&](std::size_t lane) { return base + std::size_t(rows[lane]) * stride; };
  for (int column = 0; column < kColumns; column += 4) {
    hn::Vec<D> four[4];
    // Four numbers of the last row may end behind the array.
    if (kColumns % 4 == 0 || column + 4 <= kColumns || row_of(lanes - 1) + column + 4 <= end) {
      load_columns(
          d, [&](std::size_t lane) { return row_of(lane) + column; }, four);
    } else {
      HWY_ALIGN T values[4][kBlockPixels] = {};
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        for (int i = 0; column + i < kColumns; ++i) values[i][lane] = row_of(lane)[column + i];
      }
      for (int i = 0; i < 4; ++i) four[i] = hn::Load(d, values[i]);
    }
    for (int i = 0; i < 4 && column + i < kColumns; ++i) columns[column + i] = four[i];
  }
}

/// Starts to fetch the parameters of a Gaussian that will be projected soon.
template <typename T>
HWY_INLINE void prefetch(const GaussianView<T>& gaussians, std::size_t row) {
  __builtin_prefetch(gaussians.means + 3 * row);
  __builtin_prefetch(gaussians.quats + 4 * row);
  __builtin_prefetch(gaussians.log_scales + 3 * row);
}

/// The rows of the map from `row` on.
template <typename T>
HWY_INLINE GaussianView<T> rows_from(GaussianView<T> gaussians, std::size_t row) {
  gaussians.size -= row;
  gaussians.means += 3 * row;
  gaussians.quats += 4 * row;
  gaussians.log_scales += 3 * row;
  gaussians.logit_opacities += row;
  gaussians.sh += row * std::size_t(gaussians.sh_bases) * 3;
  return gaussians;
}

template <class D>
struct Geometry {
  using V = hn::Vec<D>;
  V x, y, z, inverse_z;  ///< Centre in the camera frame.
  V x_over_z, y_over_z;
  V tan_x, tan_y;           ///< The same, clamped: where the Jacobian is evaluated.
  V quat[4], inverse_norm;  ///< Unit quaternion; 1 / norm of the stored one, 0 if it had none.
  V camera_from_gaussian[3][3];
  V scale[3];
  hn::Mask<D> scale_free[3];  ///< Scale not clamped.
  V jacobian[2][3];           ///< d(mean2d) / d(Gaussian's own axes) = J W R, px/m.
  V axes[2][3];               ///< The Gaussian's axes in the image: J W R S, px.
  /// With s = min(1, 1 / longest axis), so that nothing overflows: s, and s^2 times the projected
  /// covariance and s^4 times its determinant, before and after adding eps2d.
  V shrink;
  V cov_xx, cov_xy, cov_yy, det;
  V low_pass;  ///< s^2 eps2d
  V filtered_xx, filtered_yy, filtered_det;
};

/// Centre of the Gaussians in the camera frame.
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

template <class D, class V = hn::Vec<D>>
HWY_INLINE V dot3(const V* a, const V* b) {
  return hn::MulAdd(a[2], b[2], hn::MulAdd(a[1], b[1], hn::Mul(a[0], b[0])));
}

/// Direction from the camera to the Gaussian, map axes.
template <class D>
struct ViewDirection {
  hn::Vec<D> unit[3], inverse_length;
};

template <class D, typename T, typename Row>
HWY_INLINE ViewDirection<D> view_direction(D d, const GaussianView<T>& gaussians,
                                           const RenderSetup<T>& setup, const Row* rows) {
  ViewDirection<D> v;
  gather_rows<3>(d, gaussians.means, gaussians.means + 3 * gaussians.size, 3, rows, v.unit);
  for (int i = 0; i < 3; ++i) v.unit[i] = v.unit[i] - hn::Set(d, setup.camera_in_map[i]);
  const auto length2 = hn::Max(dot3<D>(v.unit, v.unit), hn::Set(d, T(1e-30)));
  v.inverse_length = hn::Set(d, T(1)) / hn::Sqrt(length2);
  for (int i = 0; i < 3; ++i) v.unit[i] = v.unit[i] * v.inverse_length;
  return v;
}

/// Calls visit(k, rgb) with the three coefficients of each SH basis k up to `degree`, one Gaussian
/// a lane.
template <class D, typename T, typename Row, class Visit>
HWY_INLINE void for_each_sh_basis(D d, const GaussianView<T>& gaussians, int degree,
                                  const Row* rows, Visit visit) {
  const int bases = (degree + 1) * (degree + 1);
  const std::size_t stride = std::size_t(gaussians.sh_bases) * 3;
  const T* end = gaussians.sh + gaussians.size * stride;
  hn::Vec<D> sh[12];
  int k = 0;
  for (; k + 4 <= bases; k += 4) {
    gather_rows<12>(d, gaussians.sh + 3 * k, end, stride, rows, sh);
    for (int i = 0; i < 4; ++i) visit(k + i, sh + 3 * i);
  }
  for (; k < bases; ++k) {
    gather_rows<3>(d, gaussians.sh + 3 * k, end, stride, rows, sh);
    visit(k, sh);
  }
}

template <class D, typename T>
HWY_INLINE void normalize_quats(D d, Geometry<D>& g) {
  // Divide by the largest component first: the squares of 1e20 or 1e-30 leave float's range.
  auto largest = hn::Set(d, T(1e-30));
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

/// Projects one Gaussian a lane, row rows[lane] of the arrays.
template <class D, typename T, typename Row>
HWY_INLINE Geometry<D> project(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                               const Row* rows) {
  using V = hn::Vec<D>;
  Geometry<D> g;
  const V one = hn::Set(d, T(1));
  const V two = hn::Set(d, T(2));

  V mean[3], center[3];
  gather_rows<3>(d, gaussians.means, gaussians.means + 3 * gaussians.size, 3, rows, mean);
  to_camera(d, setup, mean, center);
  g.x = center[0];
  g.y = center[1];
  g.z = center[2];
  g.inverse_z = hn::Div(one, g.z);
  g.x_over_z = hn::Mul(g.x, g.inverse_z);
  g.y_over_z = hn::Mul(g.y, g.inverse_z);
  g.tan_x = hn::Clamp(g.x_over_z, hn::Set(d, setup.min_tan_x), hn::Set(d, setup.max_tan_x));
  g.tan_y = hn::Clamp(g.y_over_z, hn::Set(d, setup.min_tan_y), hn::Set(d, setup.max_tan_y));

  gather_rows<4>(d, gaussians.quats, gaussians.quats + 4 * gaussians.size, 4, rows, g.quat);
  normalize_quats<D, T>(d, g);
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

  V log_scale[3];
  gather_rows<3>(d, gaussians.log_scales, gaussians.log_scales + 3 * gaussians.size, 3, rows,
                 log_scale);
  const V max_log_scale = hn::Set(d, T(kMaxLogScale));
  for (int k = 0; k < 3; ++k) {
    g.scale_free[k] = hn::Lt(log_scale[k], max_log_scale);
    g.scale[k] = hn::Exp(d, hn::Min(log_scale[k], max_log_scale));
  }

  const V focal_x = hn::Mul(hn::Set(d, setup.fx), g.inverse_z);
  const V focal_y = hn::Mul(hn::Set(d, setup.fy), g.inverse_z);
  V longest = one;
  for (int k = 0; k < 3; ++k) {
    const V depth_axis = g.camera_from_gaussian[2][k];
    g.jacobian[0][k] =
        hn::Mul(focal_x, hn::NegMulAdd(g.tan_x, depth_axis, g.camera_from_gaussian[0][k]));
    g.jacobian[1][k] =
        hn::Mul(focal_y, hn::NegMulAdd(g.tan_y, depth_axis, g.camera_from_gaussian[1][k]));
    g.axes[0][k] = hn::Mul(g.jacobian[0][k], g.scale[k]);
    g.axes[1][k] = hn::Mul(g.jacobian[1][k], g.scale[k]);
    longest = hn::Max(longest, hn::Max(hn::Abs(g.axes[0][k]), hn::Abs(g.axes[1][k])));
  }

  g.shrink = hn::Div(one, longest);
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
  const V focal2 = hn::Mul(focal_x, focal_y);
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
  return g;
}

/// The whitening transform of a splat (see `Splat`), 1/px.
template <class D>
struct Whitening {
  hn::Vec<D> uu, uv, vv;
};

template <class D, typename T = hn::TFromD<D>>
HWY_INLINE Whitening<D> whitening(D d, const Geometry<D>& g) {
  // log2(e) / 2 turns half the squared Mahalanobis distance into a power of two.
  const auto half_log2e = hn::Set(d, T(0.5 / kLn2));
  const auto least = hn::Set(d, T(kMinSlope));
  Whitening<D> w;
  const auto inverse_yy = hn::Div(hn::Set(d, T(1)), g.filtered_yy);
  w.uu = hn::Mul(g.shrink, hn::Sqrt(hn::Mul(half_log2e, hn::Div(g.filtered_yy, g.filtered_det))));
  w.vv = hn::Mul(g.shrink, hn::Sqrt(hn::Mul(half_log2e, inverse_yy)));
  w.uu = hn::Max(w.uu, least);
  w.vv = hn::Max(w.vv, least);
  w.uv = hn::Neg(hn::Mul(w.uu, hn::Mul(g.cov_xy, inverse_yy)));
  return w;
}

/// How the depth changes across a footprint: z = depth + u along_u + v along_v, the mean of z given
/// the place in the image. With c = cov((x, y), z) that is depth + c^T C^-1 (x, y), and C^-1 is
/// 2 ln 2 W^T W.
template <class D>
struct DepthSlant {
  using V = hn::Vec<D>;
  V axes[3];            ///< Depths of the Gaussian's axes, m.
  V along_u, along_v;   ///< m
  hn::Mask<D> slanted;  ///< Elsewhere the depth is that of the centre.
};

template <class D, typename T = hn::TFromD<D>>
HWY_INLINE DepthSlant<D> depth_slant(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                                     const Whitening<D>& w) {
  using V = hn::Vec<D>;
  DepthSlant<D> slant;
  V with_x = hn::Zero(d), with_y = hn::Zero(d);  // Covariances, px m, shrunk.
  for (int k = 0; k < 3; ++k) {
    slant.axes[k] = hn::Mul(g.camera_from_gaussian[2][k], g.scale[k]);
    with_x = hn::MulAdd(hn::Mul(g.axes[0][k], g.shrink), slant.axes[k], with_x);
    with_y = hn::MulAdd(hn::Mul(g.axes[1][k], g.shrink), slant.axes[k], with_y);
  }
  const V factor = hn::Div(hn::Set(d, T(2 * kLn2)), g.shrink);
  const V along_u = hn::Mul(factor, hn::MulAdd(w.uu, with_x, hn::Mul(w.uv, with_y)));
  const V along_v = hn::Mul(factor, hn::Mul(w.vv, with_y));
  // The footprint ends where u^2 + v^2 = log2(opacity / alpha_min).
  const V most = hn::Mul(hn::Set(d, T(kMostSlant)), g.z);
  const V change2 = hn::Mul(hn::MulAdd(along_u, along_u, hn::Mul(along_v, along_v)),
                            hn::Set(d, -setup.log2_alpha_min));
  slant.slanted = hn::And(hn::Lt(change2, hn::Mul(most, most)),
                          hn::Gt(hn::Set(d, T(setup.surface_depth)), hn::Zero(d)));
  slant.along_u = hn::IfThenElseZero(slant.slanted, along_u);
  slant.along_v = hn::IfThenElseZero(slant.slanted, along_v);
  return slant;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
