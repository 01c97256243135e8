#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "projection_backward.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "geometry-inl.hpp"
#include "kernels.hpp"
#include "sh-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// dL/d(projected covariance), symmetric, from the sums of the footprint's moments.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void covariance_gradient(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                                    const Whitening<D>& w, const hn::Vec<D>* sums,
                                    hn::Vec<D>* xx_xy_yy) {
  // With C^-1 (x - mean) = 2 ln 2 W^T (u, v): dL/dC = 1/2 sum G C^-1 d d^T C^-1
  //   = 2 (ln 2)^2 W^T [sum G (u, v)(u, v)^T] W, with no inverse of a thin covariance in sight.
  const auto factor = hn::Set(d, T(2 * kLn2 * kLn2));
  const auto uu = sums[3], uv = sums[4], vv = sums[5];
  const auto first = hn::MulAdd(w.uv, uu, w.vv * uv);   // row v of W^T M, column u
  const auto second = hn::MulAdd(w.uv, uv, w.vv * vv);  // and column v
  xx_xy_yy[0] = factor * w.uu * w.uu * uu;
  xx_xy_yy[1] = factor * w.uu * first;
  xx_xy_yy[2] = factor * hn::MulAdd(w.uv, first, w.vv * second);
  if (setup.antialias) {
    // log(alpha) holds 1/2 log det(C0) - 1/2 log det(C0 + e I), and dlog det(C) = tr(C^-1 dC).
    // The covariances are shrunk by s^2, hence the factor s^2.
    const auto half = hn::Set(d, T(0.5)) * sums[0] * g.shrink * g.shrink;
    const auto tiny = hn::Set(d, T(1e-30));
    const auto plain = hn::IfThenElseZero(hn::Gt(g.det, tiny), half / hn::Max(g.det, tiny));
    const auto filtered = half / g.filtered_det;
    xx_xy_yy[0] = xx_xy_yy[0] + plain * g.cov_yy - filtered * g.filtered_yy;
    xx_xy_yy[1] = xx_xy_yy[1] - plain * g.cov_xy + filtered * g.cov_xy;
    xx_xy_yy[2] = xx_xy_yy[2] + plain * g.cov_xx - filtered * g.filtered_xx;
  }
}

/// Gradient of the stored quaternion from that of the rotation matrix.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void quat_gradient(D d, const Geometry<D>& g, const hn::Vec<D> (*r)[3],
                              hn::Vec<D>* out) {
  using V = hn::Vec<D>;
  const V two = hn::Set(d, T(2));
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

/// Stores columns as the rows of an array, [count, columns].
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_rows3(D d, const hn::Vec<D>* columns, std::size_t count, T* out) {
  if (count == hn::Lanes(d)) {
    hn::StoreInterleaved3(columns[0], columns[1], columns[2], d, out);
    return;
  }
  HWY_ALIGN T rows[3 * kBlockPixels];
  hn::StoreInterleaved3(columns[0], columns[1], columns[2], d, rows);
  std::copy_n(rows, 3 * count, out);
}
/// Gradient of the SH coefficients of `count` Gaussians from that of their colours, into `dL_dsh`;
/// adds what comes through the viewing direction to the gradient of the mean.
template <class D, typename T, typename Row>
HWY_INLINE void color_gradient(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                               const Row* rows, std::size_t count, const hn::Vec<D>* color_gradient,
                               T* dL_dsh, hn::Vec<D>* mean_gradient) {
  using V = hn::Vec<D>;
  V basis[kMaxShBases];
  if (setup.sh_bases == 1) {
    sh_basis(d, 0, basis[0], basis[0], basis[0], basis);
    const V dc[3] = {basis[0] * color_gradient[0], basis[0] * color_gradient[1],
                     basis[0] * color_gradient[2]};
    store_rows3(d, dc, count, dL_dsh);
    return;
  }
  const int bases = (setup.sh_degree + 1) * (setup.sh_degree + 1);
  const ViewDirection<D> direction = view_direction(d, gaussians, setup, rows);
  sh_basis(d, setup.sh_degree, direction.unit[0], direction.unit[1], direction.unit[2], basis);
  V weight[kMaxShBases], sh_gradient[3 * kMaxShBases];
  for_each_sh_basis(d, gaussians, setup.sh_degree, rows, [&](int k, const V* rgb) HWY_ATTR {
    weight[k] = dot3<D>(rgb, color_gradient);
    for (int c = 0; c < 3; ++c) sh_gradient[3 * k + c] = basis[k] * color_gradient[c];
  });
  const std::size_t columns = std::size_t(setup.sh_bases) * 3;
  for (std::size_t k = 3 * bases; k < columns; ++k) sh_gradient[k] = hn::Zero(d);
  std::size_t k = 0;
  for (; k + 4 <= columns; k += 4) {
    store_columns(d, sh_gradient + k, count,
                  [&](std::size_t lane) { return dL_dsh + lane * columns + k; });
  }
  for (; k < columns; ++k) {
    HWY_ALIGN T values[kBlockPixels];
    hn::Store(sh_gradient[k], d, values);
    for (std::size_t lane = 0; lane < count; ++lane) dL_dsh[lane * columns + k] = values[lane];
  }
  if (setup.sh_degree == 0) return;
  V by_direction[3];
  sh_basis_gradient(d, setup.sh_degree, direction.unit[0], direction.unit[1], direction.unit[2],
                    weight, by_direction);
  const V along = dot3<D>(by_direction, direction.unit);
  for (int i = 0; i < 3; ++i) {
    mean_gradient[i] = hn::MulAdd(hn::NegMulAdd(along, direction.unit[i], by_direction[i]),
                                  direction.inverse_length, mean_gradient[i]);
  }
}

template <typename T>
void project_chunk_backward(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                            const Splat<T>* splats, std::size_t count, const T* sums,
                            std::size_t first_row, Gradients<T>& gradients,
                            std::array<double, 6>& twist) {
  using D = Lanes<T>;
  using V = hn::Vec<D>;
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  const V two = hn::Set(d, T(2)), fx = hn::Set(d, setup.fx), fy = hn::Set(d, setup.fy);
  const V two_ln2 = hn::Set(d, T(2 * kLn2));
  const std::size_t base = count ? splats[0].gaussian : 0;
  const GaussianView<T> local = rows_from(gaussians, base);

  // Summed in T over a chunk, Gaussian k into partial sum k % kBlockPixels; the caller sums the
  // chunks in double.
  V force_sums[3][kVectors<D>], torque_sums[3][kVectors<D>];
  for (int a = 0; a < 3; ++a) {
    std::fill_n(force_sums[a], kVectors<D>, hn::Zero(d));
    std::fill_n(torque_sums[a], kVectors<D>, hn::Zero(d));
  }
  for (std::size_t i = 0; i < count; i += lanes) {
    const std::size_t valid = std::min(lanes, count - i);
    std::uint32_t rows[kBlockPixels], places[kBlockPixels];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::size_t slot = i + std::min(lane, valid - 1);
      rows[lane] = std::uint32_t(splats[slot].gaussian - base);
      places[lane] = std::uint32_t(slot);
    }
    for (std::size_t ahead = i + 2 * lanes; ahead < std::min(i + 3 * lanes, count); ++ahead) {
      prefetch(gaussians, splats[ahead].gaussian);
    }
    const std::size_t at = first_row + i;
    for (std::size_t lane = 0; lane < valid; ++lane) {
      gradients.rows[at + lane] = splats[i + lane].gaussian;
    }
    V s[kSumsPerEntry];
    gather_rows<kSumsPerEntry>(d, sums, sums + count * kSumsPerEntry, kSumsPerEntry, places, s);
    const Geometry<D> g = project(d, local, setup, rows);
    const Whitening<D> w = whitening(d, g);

    V mean2d_x = two_ln2 * w.uu * s[1];
    V mean2d_y = two_ln2 * hn::MulAdd(w.uv, s[1], w.vv * s[2]);
    V cov[3];
    covariance_gradient(d, setup, g, w, s, cov);

    // z = depth + c^T C^-1 (x - mean): with e = C^-1 c, and q = C^-1 sum dL/dz (x - mean), which
    // is dL/dc, dL/dC = -(e q^T + q e^T) / 2 and dL/dmean = -e sum dL/dz.
    const DepthSlant<D> slant = depth_slant(d, setup, g, w);
    const V e_x = w.uu * slant.along_u, e_y = hn::MulAdd(w.uv, slant.along_u, w.vv * slant.along_v);
    const V by_u = hn::IfThenElseZero(slant.slanted, two_ln2 * s[10]);
    const V by_v = hn::IfThenElseZero(slant.slanted, two_ln2 * s[11]);
    const V q_x = w.uu * by_u, q_y = hn::MulAdd(w.uv, by_u, w.vv * by_v);
    mean2d_x = hn::NegMulAdd(e_x, s[9], mean2d_x);
    mean2d_y = hn::NegMulAdd(e_y, s[9], mean2d_y);
    cov[0] = hn::NegMulAdd(e_x, q_x, cov[0]);
    cov[1] = hn::NegMulAdd(hn::Set(d, T(0.5)), hn::MulAdd(e_x, q_y, e_y * q_x), cov[1]);
    cov[2] = hn::NegMulAdd(e_y, q_y, cov[2]);

    // C = U U^T with U = axes = jacobian * scale.
    V axes[2][3], jacobian[2][3], depth_axes[3], log_scale[3];
    for (int k = 0; k < 3; ++k) {
      axes[0][k] = two * hn::MulAdd(cov[0], g.axes[0][k], cov[1] * g.axes[1][k]);
      axes[1][k] = two * hn::MulAdd(cov[1], g.axes[0][k], cov[2] * g.axes[1][k]);
      axes[0][k] = hn::MulAdd(q_x, slant.axes[k], axes[0][k]);
      axes[1][k] = hn::MulAdd(q_y, slant.axes[k], axes[1][k]);
      depth_axes[k] = hn::MulAdd(q_x, g.axes[0][k], q_y * g.axes[1][k]);
      log_scale[k] = hn::IfThenElseZero(
          g.scale_free[k],
          hn::MulAdd(axes[0][k], g.axes[0][k],
                     hn::MulAdd(axes[1][k], g.axes[1][k], depth_axes[k] * slant.axes[k])));
      jacobian[0][k] = axes[0][k] * g.scale[k];
      jacobian[1][k] = axes[1][k] * g.scale[k];
    }

    // jacobian = J (W R): rows f/z ((W R)_0 - tan_x (W R)_2) and likewise for y.
    const V focal_x = fx * g.inverse_z, focal_y = fy * g.inverse_z;
    V rotated[3][3];  // dL/d(W R)
    V tan_x = hn::Zero(d), tan_y = hn::Zero(d), by_inverse_z = hn::Zero(d);
    for (int k = 0; k < 3; ++k) {
      rotated[0][k] = focal_x * jacobian[0][k];
      rotated[1][k] = focal_y * jacobian[1][k];
      rotated[2][k] = hn::MulSub(depth_axes[k], g.scale[k],
                                 hn::MulAdd(g.tan_x, rotated[0][k], g.tan_y * rotated[1][k]));
      tan_x = hn::NegMulAdd(rotated[0][k], g.camera_from_gaussian[2][k], tan_x);
      tan_y = hn::NegMulAdd(rotated[1][k], g.camera_from_gaussian[2][k], tan_y);
      by_inverse_z = hn::MulAdd(jacobian[0][k], g.jacobian[0][k],
                                hn::MulAdd(jacobian[1][k], g.jacobian[1][k], by_inverse_z));
    }
    // Where the Jacobian's point is clamped, moving the centre does not move it.
    tan_x = hn::IfThenElseZero(hn::Eq(g.tan_x, g.x_over_z), tan_x);
    tan_y = hn::IfThenElseZero(hn::Eq(g.tan_y, g.y_over_z), tan_y);
    tan_x = hn::MulAdd(mean2d_x, fx, tan_x);
    tan_y = hn::MulAdd(mean2d_y, fy, tan_y);
    V center[3];  // dL/d(x, y, z)
    center[0] = tan_x * g.inverse_z;
    center[1] = tan_y * g.inverse_z;
    center[2] =
        hn::NegMulAdd(hn::MulAdd(tan_x, g.x_over_z, hn::MulAdd(tan_y, g.y_over_z, by_inverse_z)),
                      g.inverse_z, s[9]);

    V rotation[3][3], mean[3], quat[4];
    for (int a = 0; a < 3; ++a) {
      const V w0 = hn::Set(d, setup.camera_from_map[0][a]);
      const V w1 = hn::Set(d, setup.camera_from_map[1][a]);
      const V w2 = hn::Set(d, setup.camera_from_map[2][a]);
      mean[a] = hn::MulAdd(w0, center[0], hn::MulAdd(w1, center[1], w2 * center[2]));
      for (int k = 0; k < 3; ++k) {
        rotation[a][k] =
            hn::MulAdd(w0, rotated[0][k], hn::MulAdd(w1, rotated[1][k], w2 * rotated[2][k]));
      }
    }
    quat_gradient(d, g, rotation, quat);

    // alpha grows with sigmoid(logit): dlog(opacity) / dlogit = 1 - opacity = sigmoid(-logit)
    V logit;
    gather_rows<1>(d, local.logit_opacities, local.logit_opacities + local.size, 1, rows, &logit);
    const V logit_gradient = s[0] / (hn::Set(d, T(1)) + hn::Exp(d, logit));

    // Where a colour is clamped, its gradient ends.
    V color[4];
    load_columns(
        d, [&](std::size_t lane) { return splats[places[lane]].color; }, color);
    for (int c = 0; c < 3; ++c) {
      color[c] = hn::IfThenElseZero(hn::Gt(color[c], hn::Set(d, setup.min_color)), s[6 + c]);
    }
    color_gradient(d, local, setup, rows, valid, color,
                   gradients.dL_dsh.data() + at * setup.sh_bases * 3, mean);

    store_rows3(d, mean, valid, gradients.dL_dmeans.data() + 3 * at);
    store_rows3(d, log_scale, valid, gradients.dL_dlog_scales.data() + 3 * at);
    store_columns(d, quat, valid,
                  [&](std::size_t lane) { return gradients.dL_dquats.data() + 4 * (at + lane); });
    HWY_ALIGN T logit_gradients[kBlockPixels];
    hn::Store(logit_gradient, d, logit_gradients);
    std::copy_n(logit_gradients, valid, gradients.dL_dlogit_opacities.data() + at);

    // camera_from_world -> exp(-xi) camera_from_world moves the centres by -(rho + phi x p), turns
    // the Gaussians by -phi, and moves the camera, on which the colours depend, by R rho.
    const auto counted = hn::FirstN(d, valid);
    const V p[3] = {g.x, g.y, g.z};
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      V torque = p[b] * center[c] - p[c] * center[b];
      V force = hn::Zero(d);
      for (int k = 0; k < 3; ++k) {
        torque = torque + (g.camera_from_gaussian[b][k] * rotated[c][k] -
                           g.camera_from_gaussian[c][k] * rotated[b][k]);
        force = hn::MulAdd(hn::Set(d, setup.camera_from_map[a][k]), mean[k], force);
      }
      V& force_sum = force_sums[a][i / lanes % kVectors<D>];
      V& torque_sum = torque_sums[a][i / lanes % kVectors<D>];
      force_sum = force_sum + hn::IfThenElseZero(counted, force);
      torque_sum = torque_sum + hn::IfThenElseZero(counted, torque);
    }
  }
  for (int a = 0; a < 3; ++a) {
    twist[a] -= double(sum_of(d, force_sums[a]));
    twist[3 + a] -= double(sum_of(d, torque_sums[a]));
  }
}

void project_chunk_backward_float(const GaussianView<float>& gaussians,
                                  const RenderSetup<float>& setup, const Splat<float>* splats,
                                  std::size_t count, const float* sums, std::size_t first_row,
                                  Gradients<float>& gradients, std::array<double, 6>& twist) {
  HWY_NAMESPACE::project_chunk_backward<float>(gaussians, setup, splats, count, sums, first_row,
                                               gradients, twist);
}
void project_chunk_backward_double(const GaussianView<double>& gaussians,
                                   const RenderSetup<double>& setup, const Splat<double>* splats,
                                   std::size_t count, const double* sums, std::size_t first_row,
                                   Gradients<double>& gradients, std::array<double, 6>& twist) {
  HWY_NAMESPACE::project_chunk_backward<double>(gaussians, setup, splats, count, sums, first_row,
                                                gradients, twist);
}

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
  (gaussians, setup, splats, count, sums, first_row, gradients, twist);
}
template <>
void project_chunk_backward(const GaussianView<double>& gaussians, const RenderSetup<double>& setup,
                            const Splat<double>* splats, std::size_t count, const double* sums,
                            std::size_t first_row, Gradients<double>& gradients,
                            std::array<double, 6>& twist) {
  HWY_DYNAMIC_DISPATCH(project_chunk_backward_double)
  (gaussians, setup, splats, count, sums, first_row, gradients, twist);
}

}  // namespace gslts::raster
#endif
