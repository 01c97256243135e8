// View-dependent colours of Gaussians from spherical harmonics and their gradients, one Gaussian a
// lane (3DGS, Kerbl et al. 2023, sec. 4). Included once per instruction set.

#if defined(GSLTS_RASTER_COLOR_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_COLOR_INL_HPP
#undef GSLTS_RASTER_COLOR_INL_HPP
#else
#define GSLTS_RASTER_COLOR_INL_HPP
#endif

#include "gslts/map/gaussian_map.hpp"
#include "rows-inl.hpp"
#include "setup.hpp"
#include "sh-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

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
  const auto length2 = hn::Max(dot3<D>(v.unit, v.unit), hn::Set(d, T(kTiny)));
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

/// Computes the colours c = max(min_color, 0.5 + sum_k Y_k(direction) sh_k).
template <class D, typename T, typename Row>
HWY_INLINE void evaluate_colors(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                                const Row* rows, hn::Vec<D>* colors) {
  using V = hn::Vec<D>;
  ViewDirection<D> direction{};
  if (setup.sh_degree > 0) direction = view_direction(d, gaussians, setup, rows);
  V basis[kMaxShBases];
  sh_basis(d, setup.sh_degree, direction.unit[0], direction.unit[1], direction.unit[2], basis);
  for (int c = 0; c < 3; ++c) colors[c] = hn::Set(d, T(0.5));
  for_each_sh_basis(d, gaussians, setup.sh_degree, rows, [&](int k, const V* rgb) HWY_ATTR {
    for (int c = 0; c < 3; ++c) colors[c] = hn::MulAdd(basis[k], rgb[c], colors[c]);
  });
  for (int c = 0; c < 3; ++c) colors[c] = hn::Max(colors[c], hn::Set(d, setup.min_color));
}

/// Stores the gradients of all SH coefficients as the first `count` rows of dL_dsh [.,columns].
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_sh_gradient(D d, const hn::Vec<D>* sh_gradient, std::size_t count,
                                  std::size_t columns, T* dL_dsh) {
  std::size_t k = 0;
  for (; k + 4 <= columns; k += 4) {
    store_columns(d, sh_gradient + k, count,
                  [&](std::size_t lane) { return dL_dsh + lane * columns + k; });
  }
  for (; k < columns; ++k) store_column(d, sh_gradient[k], count, columns, dL_dsh + k);
}

/// Adds to dL/dmean what the colour contributes through the direction e = (mean - camera) / |...|:
/// dL/dmean += (I - e e^T) dL/de / |mean - camera|.
template <class D>
HWY_INLINE void add_direction_gradient(const ViewDirection<D>& direction,
                                       const hn::Vec<D>* dL_ddirection, hn::Vec<D>* dL_dmean) {
  const auto along = dot3<D>(dL_ddirection, direction.unit);
  for (int i = 0; i < 3; ++i) {
    dL_dmean[i] = hn::MulAdd(hn::NegMulAdd(along, direction.unit[i], dL_ddirection[i]),
                             direction.inverse_length, dL_dmean[i]);
  }
}

/// Differentiates the colours of `count` Gaussians: stores the gradients of the SH coefficients and
/// adds the part that comes through the viewing direction to that of the mean.
template <class D, typename T, typename Row>
HWY_INLINE void color_gradient(D d, const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                               const Row* rows, std::size_t count, const hn::Vec<D>* dL_dcolor,
                               T* dL_dsh, hn::Vec<D>* dL_dmean) {
  using V = hn::Vec<D>;
  V basis[kMaxShBases];
  if (setup.sh_bases == 1) {
    sh_basis(d, 0, basis[0], basis[0], basis[0], basis);
    const V dc[3] = {basis[0] * dL_dcolor[0], basis[0] * dL_dcolor[1], basis[0] * dL_dcolor[2]};
    store_rows3(d, dc, count, dL_dsh);
    return;
  }
  const int bases = (setup.sh_degree + 1) * (setup.sh_degree + 1);
  const ViewDirection<D> direction = view_direction(d, gaussians, setup, rows);
  sh_basis(d, setup.sh_degree, direction.unit[0], direction.unit[1], direction.unit[2], basis);
  V dL_dbasis[kMaxShBases], sh_gradient[3 * kMaxShBases];
  for_each_sh_basis(d, gaussians, setup.sh_degree, rows, [&](int k, const V* rgb) HWY_ATTR {
    dL_dbasis[k] = dot3<D>(rgb, dL_dcolor);
    for (int c = 0; c < 3; ++c) sh_gradient[3 * k + c] = basis[k] * dL_dcolor[c];
  });
  const std::size_t columns = std::size_t(setup.sh_bases) * 3;
  for (std::size_t k = 3 * bases; k < columns; ++k) sh_gradient[k] = hn::Zero(d);
  store_sh_gradient(d, sh_gradient, count, columns, dL_dsh);
  if (setup.sh_degree == 0) return;
  V dL_ddirection[3];
  sh_basis_gradient(d, setup.sh_degree, direction.unit[0], direction.unit[1], direction.unit[2],
                    dL_dbasis, dL_ddirection);
  add_direction_gradient(direction, dL_ddirection, dL_dmean);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
