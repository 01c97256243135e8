// Footprint of a projected Gaussian: its whitening transform and the change of depth across it, one
// Gaussian a lane. Included once per instruction set.

#if defined(GSLTS_RASTER_WHITENING_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_WHITENING_INL_HPP
#undef GSLTS_RASTER_WHITENING_INL_HPP
#else
#define GSLTS_RASTER_WHITENING_INL_HPP
#endif

#include "geometry-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// The whitening transform W of a splat (see `Splat`), 1/px: with d = pixel - mean and C the
/// filtered covariance, 2 ln 2 |W d|^2 = d^T C^-1 d, so that the 2D Gaussian of Kerbl et al. 2023,
/// eq. 4, is 2^-|W d|^2.
template <class D>
struct Whitening {
  hn::Vec<D> uu, uv, vv;
};

template <class D, typename T = hn::TFromD<D>>
HWY_INLINE Whitening<D> whitening(D d, const Geometry<D>& g) {
  // log2(e) / 2 turns half the squared Mahalanobis distance into a power of two.
  const auto half_log2e = hn::Set(d, T(0.5 / kLn2));
  const auto min_slope = hn::Set(d, T(kMinSlope));
  Whitening<D> w;
  const auto inverse_yy = hn::Div(hn::Set(d, T(1)), g.filtered_yy);
  w.uu = hn::Mul(g.shrink, hn::Sqrt(hn::Mul(half_log2e, hn::Div(g.filtered_yy, g.filtered_det))));
  w.vv = hn::Mul(g.shrink, hn::Sqrt(hn::Mul(half_log2e, inverse_yy)));
  w.uu = hn::Max(w.uu, min_slope);
  w.vv = hn::Max(w.vv, min_slope);
  w.uv = hn::Neg(hn::Mul(w.uu, hn::Mul(g.cov_xy, inverse_yy)));
  return w;
}

/// Change of depth across a footprint, z = depth + u along_u + v along_v: the planar depth
/// z = z_c + p (du, dv) of RaDe-GS (Zhang et al. 2024). It is the mean of z given the position in
/// the image: with c = cov((x, y), z), p = c^T C^-1, and C^-1 = 2 ln 2 W^T W.
template <class D>
struct DepthSlant {
  using V = hn::Vec<D>;
  V axes[3];            ///< Depths of the Gaussian's axes, m.
  V along_u, along_v;   ///< m
  hn::Mask<D> slanted;  ///< Elsewhere the depth is that of the centre.
};

/// Depths of the Gaussian's axes, the third row of W R S, m.
template <class D>
HWY_INLINE void depth_axes(const Geometry<D>& g, hn::Vec<D>* axes) {
  for (int k = 0; k < 3; ++k) axes[k] = hn::Mul(g.camera_from_gaussian[2][k], g.scale[k]);
}

template <class D, typename T = hn::TFromD<D>>
HWY_INLINE DepthSlant<D> depth_slant(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                                     const Whitening<D>& w) {
  using V = hn::Vec<D>;
  DepthSlant<D> slant;
  depth_axes(g, slant.axes);
  V with_x = hn::Zero(d), with_y = hn::Zero(d);  // c, times `shrink`, px m.
  for (int k = 0; k < 3; ++k) {
    with_x = hn::MulAdd(hn::Mul(g.axes[0][k], g.shrink), slant.axes[k], with_x);
    with_y = hn::MulAdd(hn::Mul(g.axes[1][k], g.shrink), slant.axes[k], with_y);
  }
  const V factor = hn::Div(hn::Set(d, T(2 * kLn2)), g.shrink);
  const V along_u = hn::Mul(factor, hn::MulAdd(w.uu, with_x, hn::Mul(w.uv, with_y)));
  const V along_v = hn::Mul(factor, hn::Mul(w.vv, with_y));
  // The footprint ends where u^2 + v^2 = log2(opacity / alpha_min).
  const V max_change = hn::Mul(hn::Set(d, T(kMaxSlant)), g.z);
  const V change2 = hn::Mul(hn::MulAdd(along_u, along_u, hn::Mul(along_v, along_v)),
                            hn::Set(d, -setup.log2_alpha_min));
  slant.slanted = hn::And(hn::Lt(change2, hn::Mul(max_change, max_change)),
                          hn::Gt(hn::Set(d, T(setup.surface_depth)), hn::Zero(d)));
  slant.along_u = hn::IfThenElseZero(slant.slanted, along_u);
  slant.along_v = hn::IfThenElseZero(slant.slanted, along_v);
  return slant;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
