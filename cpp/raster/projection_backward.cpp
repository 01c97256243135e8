#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "projection_backward.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "color-inl.hpp"
#include "kernels.hpp"
#include "whitening-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

// The chain rule through the projection, from the sums over pixels (`EntrySum`) back to the stored
// parameters; the forward pass is in geometry-inl.hpp and whitening-inl.hpp. One Gaussian a lane.

/// Gradients of the loss with respect to a splat in the image.
template <class D>
struct SplatGradient {
  using V = hn::Vec<D>;
  V mean_x, mean_y;          ///< dL/dmean2d, 1/px
  V cov_xx, cov_xy, cov_yy;  ///< dL/dC, symmetric, 1/px^2
  V slant_x, slant_y;        ///< dL/dc with c = cov((x, y), z), 1/(px m)
};

/// Differentiates log(alpha) = log(o) - ln 2 |W d|^2 with respect to mean and covariance C.
///
/// With C^-1 d = 2 ln 2 W^T (u, v): dL/dmean = sum G C^-1 d = 2 ln 2 W^T sum G (u, v), and dL/dC =
/// 1/2 sum G C^-1 d d^T C^-1 = 2 (ln 2)^2 W^T [sum G (u, v)(u, v)^T] W, without the inverse of a
/// thin covariance.
template <class D>
HWY_INLINE SplatGradient<D> footprint_gradient(D d, const Whitening<D>& w, const hn::Vec<D>* sums) {
  using T = hn::TFromD<D>;
  SplatGradient<D> out;
  const auto two_ln2 = hn::Set(d, T(2 * kLn2));
  out.mean_x = two_ln2 * w.uu * sums[kSumU];
  out.mean_y = two_ln2 * hn::MulAdd(w.uv, sums[kSumU], w.vv * sums[kSumV]);
  const auto factor = hn::Set(d, T(2 * kLn2 * kLn2));
  const auto uu = sums[kSumUU], uv = sums[kSumUV], vv = sums[kSumVV];
  const auto first = hn::MulAdd(w.uv, uu, w.vv * uv);   // row v of W^T M, column u
  const auto second = hn::MulAdd(w.uv, uv, w.vv * vv);  // and column v
  out.cov_xx = factor * w.uu * w.uu * uu;
  out.cov_xy = factor * w.uu * first;
  out.cov_yy = factor * hn::MulAdd(w.uv, first, w.vv * second);
  return out;
}

/// Adds the gradient of the opacity's factor sqrt(det(C0) / det(C0 + e I)): log(alpha) holds 1/2
/// log det(C0) - 1/2 log det(C0 + e I), and dlog det(C) = tr(C^-1 dC).
template <class D>
HWY_INLINE void add_antialias_gradient(D d, const Geometry<D>& g, const hn::Vec<D>* sums,
                                       SplatGradient<D>& out) {
  using T = hn::TFromD<D>;
  // The covariances are shrunk by s^2, hence the factor s^2.
  const auto half = hn::Set(d, T(0.5)) * sums[kSum] * g.shrink * g.shrink;
  const auto tiny = hn::Set(d, T(kTiny));
  const auto plain = hn::IfThenElseZero(hn::Gt(g.det, tiny), half / hn::Max(g.det, tiny));
  const auto filtered = half / g.filtered_det;
  out.cov_xx = out.cov_xx + plain * g.cov_yy - filtered * g.filtered_yy;
  out.cov_xy = out.cov_xy - plain * g.cov_xy + filtered * g.cov_xy;
  out.cov_yy = out.cov_yy + plain * g.cov_xx - filtered * g.filtered_xx;
}

/// Adds the gradient of the depth at the pixels, z = z_c + c^T C^-1 (x - mean) (RaDe-GS, Zhang et
/// al. 2024).
///
/// With e = C^-1 c and q = C^-1 sum dL/dz (x - mean), which is dL/dc: dL/dC = -(e q^T + q e^T) / 2
/// and dL/dmean = -e sum dL/dz.
template <class D>
HWY_INLINE void add_slant_gradient(D d, const Whitening<D>& w, const DepthSlant<D>& slant,
                                   const hn::Vec<D>* sums, SplatGradient<D>& out) {
  using T = hn::TFromD<D>;
  const auto two_ln2 = hn::Set(d, T(2 * kLn2));
  const auto e_x = w.uu * slant.along_u;
  const auto e_y = hn::MulAdd(w.uv, slant.along_u, w.vv * slant.along_v);
  const auto by_u = hn::IfThenElseZero(slant.slanted, two_ln2 * sums[kSumDepthU]);
  const auto by_v = hn::IfThenElseZero(slant.slanted, two_ln2 * sums[kSumDepthV]);
  out.slant_x = w.uu * by_u;
  out.slant_y = hn::MulAdd(w.uv, by_u, w.vv * by_v);
  out.mean_x = hn::NegMulAdd(e_x, sums[kSumDepth], out.mean_x);
  out.mean_y = hn::NegMulAdd(e_y, sums[kSumDepth], out.mean_y);
  out.cov_xx = hn::NegMulAdd(e_x, out.slant_x, out.cov_xx);
  out.cov_xy = hn::NegMulAdd(hn::Set(d, T(0.5)), hn::MulAdd(e_x, out.slant_y, e_y * out.slant_x),
                             out.cov_xy);
  out.cov_yy = hn::NegMulAdd(e_y, out.slant_y, out.cov_yy);
}

/// Gradients of the loss with respect to the Gaussian in the camera frame.
template <class D>
struct CameraGradient {
  using V = hn::Vec<D>;
  V log_scale[3];
  V jacobian[2][3];  ///< dL/d(J W R)
  V rotated[3][3];   ///< dL/d(W R)
  V center[3];       ///< dL/d(x, y, z), 1/m
};

/// Differentiates C = U U^T, U = J W R S, and c = U z with the depths z of the Gaussian's axes.
/// @return  log_scale, jacobian, and in rotated[2] only what comes through z.
template <class D>
HWY_INLINE CameraGradient<D> axes_gradient(D d, const Geometry<D>& g, const DepthSlant<D>& slant,
                                           const SplatGradient<D>& s) {
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;
  const V two = hn::Set(d, T(2));
  CameraGradient<D> out;
  for (int k = 0; k < 3; ++k) {
    V axis_x = two * hn::MulAdd(s.cov_xx, g.axes[0][k], s.cov_xy * g.axes[1][k]);
    V axis_y = two * hn::MulAdd(s.cov_xy, g.axes[0][k], s.cov_yy * g.axes[1][k]);
    axis_x = hn::MulAdd(s.slant_x, slant.axes[k], axis_x);
    axis_y = hn::MulAdd(s.slant_y, slant.axes[k], axis_y);
    const V axis_z = hn::MulAdd(s.slant_x, g.axes[0][k], s.slant_y * g.axes[1][k]);
    out.log_scale[k] = hn::IfThenElseZero(
        g.scale_free[k],
        hn::MulAdd(axis_x, g.axes[0][k], hn::MulAdd(axis_y, g.axes[1][k], axis_z * slant.axes[k])));
    out.jacobian[0][k] = axis_x * g.scale[k];
    out.jacobian[1][k] = axis_y * g.scale[k];
    out.rotated[2][k] = axis_z;
  }
  return out;
}

/// Differentiates J W R, with rows f/z ((W R)_0 - tan_x (W R)_2) and likewise for y, and the mean
/// (f x / z + c) in the image.
template <class D, typename T>
HWY_INLINE void center_gradient(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                                const SplatGradient<D>& s, hn::Vec<D> dL_dz,
                                CameraGradient<D>& out) {
  using V = hn::Vec<D>;
  V tan_x = hn::Zero(d), tan_y = hn::Zero(d), by_inverse_z = hn::Zero(d);
  for (int k = 0; k < 3; ++k) {
    out.rotated[0][k] = g.focal_x * out.jacobian[0][k];
    out.rotated[1][k] = g.focal_y * out.jacobian[1][k];
    out.rotated[2][k] =
        hn::MulSub(out.rotated[2][k], g.scale[k],
                   hn::MulAdd(g.tan_x, out.rotated[0][k], g.tan_y * out.rotated[1][k]));
    tan_x = hn::NegMulAdd(out.rotated[0][k], g.camera_from_gaussian[2][k], tan_x);
    tan_y = hn::NegMulAdd(out.rotated[1][k], g.camera_from_gaussian[2][k], tan_y);
    by_inverse_z = hn::MulAdd(out.jacobian[0][k], g.jacobian[0][k],
                              hn::MulAdd(out.jacobian[1][k], g.jacobian[1][k], by_inverse_z));
  }
  // Where the Jacobian's point is clamped, moving the centre does not move it.
  tan_x = hn::IfThenElseZero(hn::Eq(g.tan_x, g.x_over_z), tan_x);
  tan_y = hn::IfThenElseZero(hn::Eq(g.tan_y, g.y_over_z), tan_y);
  tan_x = hn::MulAdd(s.mean_x, hn::Set(d, setup.fx), tan_x);
  tan_y = hn::MulAdd(s.mean_y, hn::Set(d, setup.fy), tan_y);
  out.center[0] = tan_x * g.inverse_z;
  out.center[1] = tan_y * g.inverse_z;
  out.center[2] =
      hn::NegMulAdd(hn::MulAdd(tan_x, g.x_over_z, hn::MulAdd(tan_y, g.y_over_z, by_inverse_z)),
                    g.inverse_z, dL_dz);
}

/// Differentiates everything between the sums over pixels and the camera frame.
template <class D, typename T>
HWY_INLINE CameraGradient<D> camera_gradient(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                                             const hn::Vec<D>* sums) {
  const Whitening<D> w = whitening(d, g);
  const DepthSlant<D> slant = depth_slant(d, setup, g, w);
  SplatGradient<D> splat = footprint_gradient(d, w, sums);
  if (setup.antialias) add_antialias_gradient(d, g, sums, splat);
  add_slant_gradient(d, w, slant, sums, splat);
  CameraGradient<D> out = axes_gradient(d, g, slant, splat);
  center_gradient(d, setup, g, splat, sums[kSumDepth], out);
  return out;
}

/// Multiplies a vector of the camera frame by W^T: turns it into the map's axes.
template <class D, typename T, class V = hn::Vec<D>>
HWY_INLINE V to_map(D d, const RenderSetup<T>& setup, int axis, V x, V y, V z) {
  return hn::MulAdd(hn::Set(d, setup.camera_from_map[0][axis]), x,
                    hn::MulAdd(hn::Set(d, setup.camera_from_map[1][axis]), y,
                               hn::Set(d, setup.camera_from_map[2][axis]) * z));
}

/// Differentiates R and the normalization with respect to the stored quaternion.
/// @param r  dL/dR
template <class D>
HWY_INLINE void quat_gradient(D d, const Geometry<D>& g, const hn::Vec<D> (*r)[3],
                              hn::Vec<D>* out) {
  using V = hn::Vec<D>;
  const V two = hn::Set(d, hn::TFromD<D>(2));
  const V w = g.quat[0], x = g.quat[1], y = g.quat[2], z = g.quat[3];
  const V s01 = r[0][1] + r[1][0], s02 = r[0][2] + r[2][0], s12 = r[1][2] + r[2][1];
  const V a21 = r[2][1] - r[1][2], a02 = r[0][2] - r[2][0], a10 = r[1][0] - r[0][1];
  V q[4];
  q[0] = two * (x * a21 + y * a02 + z * a10);
  q[1] = two * (y * s01 + z * s02 + w * a21 - two * x * (r[1][1] + r[2][2]));
  q[2] = two * (x * s01 + z * s12 + w * a02 - two * y * (r[0][0] + r[2][2]));
  q[3] = two * (x * s02 + y * s12 + w * a10 - two * z * (r[0][0] + r[1][1]));
  V along = hn::Zero(d);
  for (int i = 0; i < 4; ++i) along = hn::MulAdd(q[i], g.quat[i], along);
  for (int i = 0; i < 4; ++i) out[i] = hn::NegMulAdd(along, g.quat[i], q[i]) * g.inverse_norm;
}

/// Differentiates the opacity: dlog(o) / dlogit = 1 - o = sigmoid(-logit).
template <class D, typename T, typename Row>
HWY_INLINE hn::Vec<D> logit_gradient(D d, const GaussianView<T>& gaussians, const Row* rows,
                                     hn::Vec<D> dL_dlog_opacity) {
  hn::Vec<D> logit;
  gather_rows<1>(d, gaussians.logit_opacities, gaussians.logit_opacities + gaussians.size, 1, rows,
                 &logit);
  return dL_dlog_opacity / (hn::Set(d, T(1)) + hn::Exp(d, logit));
}

/// The Gaussians of one vector; the last one fills the lanes beyond `count`.
template <typename T>
struct LaneRows {
  std::size_t count;
  const Splat<T>* splats[kBlockPixels];
  std::uint32_t slots[kBlockPixels];  ///< In the chunk.
  std::uint32_t rows[kBlockPixels];   ///< Relative to the first splat's.

  LaneRows(const Splat<T>* chunk, std::size_t chunk_size, std::size_t begin, std::size_t lanes)
      : count(std::min(lanes, chunk_size - begin)) {
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      slots[lane] = std::uint32_t(begin + std::min(lane, count - 1));
      splats[lane] = chunk + slots[lane];
      rows[lane] = std::uint32_t(splats[lane]->gaussian - chunk->gaussian);
    }
  }
};

/// Computes the gradients of the colours before they were clamped: 0 where they were.
template <class D, typename T>
HWY_INLINE void clamp_color_gradient(D d, const RenderSetup<T>& setup, const LaneRows<T>& lanes,
                                     const hn::Vec<D>* sums, hn::Vec<D>* dL_dcolor) {
  hn::Vec<D> color[4];
  load_columns(
      d, [&](std::size_t lane) { return lanes.splats[lane]->color; }, color);
  for (int c = 0; c < 3; ++c) {
    dL_dcolor[c] =
        hn::IfThenElseZero(hn::Gt(color[c], hn::Set(d, setup.min_color)), sums[kSumRed + c]);
  }
}

/// Sums the gradient of the camera's twist over the Gaussians of a chunk.
///
/// camera_from_world -> exp(-xi) camera_from_world moves the centres by -(rho + phi x p), turns the
/// Gaussians by -phi, and moves the camera, on which the colours depend, by R rho.
template <class D>
class TwistSum {
 public:
  using V = hn::Vec<D>;
  using T = hn::TFromD<D>;

  HWY_INLINE explicit TwistSum(D d) {
    for (int a = 0; a < 3; ++a) {
      std::fill_n(force_[a], kVectors<D>, hn::Zero(d));
      std::fill_n(torque_[a], kVectors<D>, hn::Zero(d));
    }
  }

  /// Adds the first `count` lanes of vector i of the chunk.
  HWY_INLINE void add(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                      const CameraGradient<D>& camera, const V* dL_dmean, std::size_t i,
                      std::size_t count) {
    const auto counted = hn::FirstN(d, count);
    const V p[3] = {g.x, g.y, g.z};
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      V torque = p[b] * camera.center[c] - p[c] * camera.center[b];
      V force = hn::Zero(d);
      for (int k = 0; k < 3; ++k) {
        torque = torque + (g.camera_from_gaussian[b][k] * camera.rotated[c][k] -
                           g.camera_from_gaussian[c][k] * camera.rotated[b][k]);
        force = hn::MulAdd(hn::Set(d, setup.camera_from_map[a][k]), dL_dmean[k], force);
      }
      V& force_sum = force_[a][i % kVectors<D>];
      V& torque_sum = torque_[a][i % kVectors<D>];
      force_sum = force_sum + hn::IfThenElseZero(counted, force);
      torque_sum = torque_sum + hn::IfThenElseZero(counted, torque);
    }
  }

  /// Adds the gradient to (rho, phi).
  HWY_INLINE void add_to(D d, std::array<double, 6>& twist) const {
    for (int a = 0; a < 3; ++a) {
      twist[a] -= double(sum_of(d, force_[a]));
      twist[3 + a] -= double(sum_of(d, torque_[a]));
    }
  }

 private:
  // Summed in T over a chunk, Gaussian k into partial sum k % kBlockPixels; the caller sums the
  // chunks in double.
  V force_[3][kVectors<D>], torque_[3][kVectors<D>];
};

/// Differentiates the parameters of the Gaussians, and stores them as rows `at`... of `out`.
/// @param dL_dmean  Receives the gradient of the means.
template <class D, typename T>
HWY_INLINE void store_gradients(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                                const LaneRows<T>& lanes, const Geometry<D>& g,
                                const CameraGradient<D>& camera, const hn::Vec<D>* sums,
                                std::size_t at, Gradients<T>& out, hn::Vec<D>* dL_dmean) {
  using V = hn::Vec<D>;
  V rotation[3][3], quat[4], dL_dcolor[3];
  for (int a = 0; a < 3; ++a) {
    dL_dmean[a] = to_map(d, setup, a, camera.center[0], camera.center[1], camera.center[2]);
    for (int k = 0; k < 3; ++k) {
      rotation[a][k] =
          to_map(d, setup, a, camera.rotated[0][k], camera.rotated[1][k], camera.rotated[2][k]);
    }
  }
  quat_gradient(d, g, rotation, quat);
  const V dL_dlogit = logit_gradient(d, gaussians, lanes.rows, sums[kSum]);
  clamp_color_gradient(d, setup, lanes, sums, dL_dcolor);
  color_gradient(d, gaussians, setup, lanes.rows, lanes.count, dL_dcolor,
                 out.dL_dsh.data() + at * setup.sh_bases * 3, dL_dmean);

  store_rows3(d, dL_dmean, lanes.count, out.dL_dmeans.data() + 3 * at);
  store_rows3(d, camera.log_scale, lanes.count, out.dL_dlog_scales.data() + 3 * at);
  store_columns(d, quat, lanes.count,
                [&](std::size_t lane) { return out.dL_dquats.data() + 4 * (at + lane); });
  store_column(d, dL_dlogit, lanes.count, 1, out.dL_dlogit_opacities.data() + at);
  for (std::size_t lane = 0; lane < lanes.count; ++lane) {
    out.rows[at + lane] = lanes.splats[lane]->gaussian;
  }
}

template <typename T>
void project_chunk_backward(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                            const Splat<T>* splats, std::size_t count, const T* sums,
                            std::size_t first_row, Gradients<T>& gradients,
                            std::array<double, 6>& twist) {
  using D = Lanes<T>;
  const D d;
  const std::size_t vector = hn::Lanes(d);
  const GaussianView<T> chunk_rows = rows_from(gaussians, count ? splats[0].gaussian : 0);
  TwistSum<D> twist_sum(d);
  for (std::size_t i = 0; i < count; i += vector) {
    const LaneRows<T> lanes(splats, count, i, vector);
    for (std::size_t ahead = i + 2 * vector; ahead < std::min(i + 3 * vector, count); ++ahead) {
      prefetch(gaussians, splats[ahead].gaussian);
    }
    hn::Vec<D> s[kSumsPerEntry], dL_dmean[3];
    gather_rows<kSumsPerEntry>(d, sums, sums + count * kSumsPerEntry, kSumsPerEntry, lanes.slots,
                               s);
    const Geometry<D> g = project(d, chunk_rows, setup, lanes.rows);
    const CameraGradient<D> camera = camera_gradient(d, setup, g, s);
    store_gradients(d, chunk_rows, setup, lanes, g, camera, s, first_row + i, gradients, dL_dmean);
    twist_sum.add(d, setup, g, camera, dL_dmean, i / vector, lanes.count);
  }
  twist_sum.add_to(d, twist);
}

auto project_chunk_backward_float() { return &HWY_NAMESPACE::project_chunk_backward<float>; }
auto project_chunk_backward_double() { return &HWY_NAMESPACE::project_chunk_backward<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(project_chunk_backward_float);
HWY_EXPORT(project_chunk_backward_double);

template <>
void project_chunk_backward(const GaussianView<float>& gaussians, const RenderSetup<float>& setup,
                            const Splat<float>* splats, std::size_t count, const float* sums,
                            std::size_t first_row, Gradients<float>& gradients,
                            std::array<double, 6>& twist) {
  HWY_DYNAMIC_DISPATCH(project_chunk_backward_float)
  ()(gaussians, setup, splats, count, sums, first_row, gradients, twist);
}
template <>
void project_chunk_backward(const GaussianView<double>& gaussians, const RenderSetup<double>& setup,
                            const Splat<double>* splats, std::size_t count, const double* sums,
                            std::size_t first_row, Gradients<double>& gradients,
                            std::array<double, 6>& twist) {
  HWY_DYNAMIC_DISPATCH(project_chunk_backward_double)
  ()(gaussians, setup, splats, count, sums, first_row, gradients, twist);
}

}  // namespace gslts::raster
#endif
