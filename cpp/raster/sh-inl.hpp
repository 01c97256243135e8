// Real spherical harmonics up to degree 3, one direction a lane, with the order and signs of 3DGS
// (Kerbl et al. 2023; the polynomials are those of Sloan, "Efficient Spherical Harmonic
// Evaluation", 2013). Included once per instruction set.

#if defined(GSLTS_RASTER_SH_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_SH_INL_HPP
#undef GSLTS_RASTER_SH_INL_HPP
#else
#define GSLTS_RASTER_SH_INL_HPP
#endif

#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Basis functions of the degrees 0 to 3.
constexpr int kMaxShBases = 16;

/// Factors of the real spherical harmonics of each degree, as in 3DGS (Kerbl et al. 2023).
constexpr double kSh0 = 0.28209479177387814;
constexpr double kSh1 = 0.4886025119029199;
constexpr double kSh2[3] = {1.0925484305920792, 0.31539156525252005, 0.5462742152960396};
constexpr double kSh3[5] = {0.5900435899266435, 2.890611442640554, 0.4570457994644658,
                            0.3731763325901154, 1.445305721320277};

/// Values of the (degree + 1)^2 basis functions in the unit directions (x, y, z).
template <class D, class V = hn::Vec<D>>
HWY_INLINE void sh_basis(D d, int degree, V x, V y, V z, V* basis) {
  const auto c = [d](double value) HWY_ATTR { return hn::Set(d, hn::TFromD<D>(value)); };
  basis[0] = c(kSh0);
  if (degree < 1) return;
  basis[1] = c(-kSh1) * y;
  basis[2] = c(kSh1) * z;
  basis[3] = c(-kSh1) * x;
  if (degree < 2) return;
  const V xx = x * x, yy = y * y, zz = z * z;
  basis[4] = c(kSh2[0]) * x * y;
  basis[5] = c(-kSh2[0]) * y * z;
  basis[6] = c(kSh2[1]) * (c(2) * zz - xx - yy);
  basis[7] = c(-kSh2[0]) * x * z;
  basis[8] = c(kSh2[2]) * (xx - yy);
  if (degree < 3) return;
  basis[9] = c(-kSh3[0]) * y * (c(3) * xx - yy);
  basis[10] = c(kSh3[1]) * x * y * z;
  basis[11] = c(-kSh3[2]) * y * (c(4) * zz - xx - yy);
  basis[12] = c(kSh3[3]) * z * (c(2) * zz - c(3) * (xx + yy));
  basis[13] = c(-kSh3[2]) * x * (c(4) * zz - xx - yy);
  basis[14] = c(kSh3[4]) * z * (xx - yy);
  basis[15] = c(-kSh3[0]) * x * (xx - c(3) * yy);
}

/// Gradient of sum_k weights[k] basis[k] with respect to (x, y, z), taken as independent.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void sh_basis_gradient(D d, int degree, V x, V y, V z, const V* weights, V* gradient) {
  const auto c = [d](double value) HWY_ATTR { return hn::Set(d, hn::TFromD<D>(value)); };
  const V* w = weights;
  gradient[0] = gradient[1] = gradient[2] = hn::Zero(d);
  if (degree < 1) return;
  V gx = c(-kSh1) * w[3];
  V gy = c(-kSh1) * w[1];
  V gz = c(kSh1) * w[2];
  if (degree >= 2) {
    const V a = c(kSh2[0]), b = c(2 * kSh2[1]), e = c(2 * kSh2[2]);
    gx = gx + a * (y * w[4] - z * w[7]) - b * x * w[6] + e * x * w[8];
    gy = gy + a * (x * w[4] - z * w[5]) - b * y * w[6] - e * y * w[8];
    gz = gz - a * (y * w[5] + x * w[7]) + c(2) * b * z * w[6];
  }
  if (degree >= 3) {
    const V xx = x * x, yy = y * y, zz = z * z;
    const V a = c(3 * kSh3[0]), b = c(kSh3[1]), e = c(kSh3[2]), f = c(3 * kSh3[3]);
    const V h = c(kSh3[4]), two = c(2), three = c(3), four = c(4);
    gx = gx - two * a * x * y * (w[9]) + b * y * z * w[10] + two * e * x * y * w[11] -
         two * f * x * z * w[12] - e * (four * zz - three * xx - yy) * w[13] +
         two * h * x * z * w[14] - a * (xx - yy) * w[15];
    gy = gy - a * (xx - yy) * w[9] + b * x * z * w[10] - e * (four * zz - xx - three * yy) * w[11] -
         two * f * y * z * w[12] + two * e * x * y * w[13] - two * h * y * z * w[14] +
         two * a * x * y * w[15];
    gz = gz + b * x * y * w[10] - c(8) * e * z * (y * w[11] + x * w[13]) +
         f * (two * zz - xx - yy) * w[12] + h * (xx - yy) * w[14];
  }
  gradient[0] = gx;
  gradient[1] = gy;
  gradient[2] = gz;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
