// Culling of Gaussians that cannot be seen in the wanted region, one Gaussian a lane. Included once
// per instruction set.

#if defined(GSLTS_RASTER_CULLING_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_CULLING_INL_HPP
#undef GSLTS_RASTER_CULLING_INL_HPP
#else
#define GSLTS_RASTER_CULLING_INL_HPP
#endif

#include <algorithm>
#include <cmath>

#include "geometry-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Bounds footprints by circles around the projected centres.
template <class D>
struct BoundingCircle {
  using V = hn::Vec<D>;
  V x, y, radius;  ///< px
  V depth;         ///< m

  template <typename T>
  HWY_INLINE BoundingCircle(D d, const RenderSetup<T>& setup, const V* mean, const V* log_scale) {
    V center[3];
    to_camera(d, setup, mean, center);
    depth = center[2];
    const V inverse_z = hn::Div(hn::Set(d, T(1)), depth);
    const V tan_x = hn::Mul(center[0], inverse_z), tan_y = hn::Mul(center[1], inverse_z);
    const V clamped_x = hn::Clamp(tan_x, hn::Set(d, setup.min_tan_x), hn::Set(d, setup.max_tan_x));
    const V clamped_y = hn::Clamp(tan_y, hn::Set(d, setup.min_tan_y), hn::Set(d, setup.max_tan_y));
    // |J|^2 <= (f / z)^2 (1 + tan_x^2 + tan_y^2) bounds the longest axis in the image.
    const V secant = hn::Sqrt(
        hn::MulAdd(clamped_x, clamped_x, hn::MulAdd(clamped_y, clamped_y, hn::Set(d, T(1)))));
    const V largest = hn::Min(hn::Max(hn::Max(log_scale[0], log_scale[1]), log_scale[2]),
                              hn::Set(d, T(kMaxLogScale)));
    const T focal = std::max(setup.fx, setup.fy);
    const V sigma =
        hn::Mul(hn::Mul(hn::Exp(d, largest), secant), hn::Mul(hn::Set(d, focal), inverse_z));
    // alpha >= alpha_min within this many standard deviations, for an opacity of 1.
    const T extent = std::sqrt(T(-2 * kLn2) * setup.log2_alpha_min);
    // Half a pixel and the low-pass filter, by sqrt(a^2 + b) <= a + sqrt(b); 1 % for rounding.
    radius = hn::MulAdd(hn::Set(d, T(1.01) * extent), sigma,
                        hn::Set(d, T(1) + T(1.01) * extent * std::sqrt(setup.eps2d_px2)));
    x = hn::MulAdd(tan_x, hn::Set(d, setup.fx), hn::Set(d, setup.cx));
    y = hn::MulAdd(tan_y, hn::Set(d, setup.fy), hn::Set(d, setup.cy));
  }

  template <typename T>
  HWY_INLINE hn::Mask<D> meets(D d, const RenderSetup<T>& setup) const {
    const V x0 = hn::Set(d, T(setup.region.x0)), x1 = hn::Set(d, T(setup.region.x1));
    const V y0 = hn::Set(d, T(setup.region.y0)), y1 = hn::Set(d, T(setup.region.y1));
    const auto in_x = hn::And(hn::Gt(hn::Add(x, radius), x0), hn::Lt(hn::Sub(x, radius), x1));
    const auto in_y = hn::And(hn::Gt(hn::Add(y, radius), y0), hn::Lt(hn::Sub(y, radius), y1));
    const auto in_z =
        hn::And(hn::Gt(depth, hn::Set(d, setup.near_m)), hn::Le(depth, hn::Set(d, setup.far_m)));
    return hn::And(in_z, hn::And(in_x, in_y));
  }
};

/// Lists the Gaussians of a chunk that may touch the wanted region: between the near and the far
/// plane, and with a bounding circle that meets the region.
/// @param begin  First Gaussian of the chunk.
/// @param n  Number of Gaussians of the chunk.
/// @param rows  Receives their rows, relative to `begin`.
/// @return  Their number.
template <typename T, typename Row>
std::size_t cull_chunk(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                       std::size_t begin, std::size_t n, Row* rows) {
  const Lanes<T> d;
  const hn::RebindToSigned<decltype(d)> di;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t count = 0;
  for (std::size_t i = 0; i < n; i += lanes) {
    const std::size_t valid = std::min(lanes, n - i);
    hn::Vec<decltype(d)> mean[3], log_scale[3];
    load_rows3(d, gaussians.means + 3 * (begin + i), valid, mean);
    load_rows3(d, gaussians.log_scales + 3 * (begin + i), valid, log_scale);
    const BoundingCircle<Lanes<T>> circle(d, setup, mean, log_scale);
    const auto seen = hn::And(circle.meets(d, setup), hn::FirstN(d, valid));
    const auto index = hn::Iota(di, static_cast<Row>(i));
    const auto seen_index = hn::RebindMask(di, seen);
    hn::StoreU(hn::Compress(index, seen_index), di, rows + count);
    count += hn::CountTrue(di, seen_index);
  }
  return count;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
