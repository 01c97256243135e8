#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "projection.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <cstring>

#include "geometry-inl.hpp"
#include "kernels.hpp"
#include "sh-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

template <typename T>
bool chunk_is_finite(const GaussianView<T>& gaussians, std::size_t begin, std::size_t n) {
  const auto finite = [&](const T* values, std::size_t stride) {
    return stride == 0 || all_finite(values + begin * stride, n * stride);
  };
  return finite(gaussians.means, 3) && finite(gaussians.quats, 4) &&
         finite(gaussians.log_scales, 3) && finite(gaussians.logit_opacities, 1) &&
         finite(gaussians.sh, std::size_t(gaussians.sh_bases) * 3) &&
         finite(gaussians.features, std::size_t(gaussians.feature_dims));
}

/// Rows, relative to the chunk's first, of the Gaussians that may touch the wanted region: in front
/// of the near plane, and with the region inside a circle that surely holds the footprint.
template <typename T, typename Row>
std::size_t cull_chunk(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                       std::size_t begin, std::size_t n, Row* rows) {
  const Lanes<T> d;
  const hn::RebindToSigned<decltype(d)> di;
  const std::size_t lanes = hn::Lanes(d);
  const T focal = std::max(setup.fx, setup.fy);
  // alpha >= alpha_min within this many standard deviations, for an opacity of 1.
  const T extent = std::sqrt(T(-2 * kLn2) * setup.log2_alpha_min);
  const auto x0 = hn::Set(d, T(setup.region.x0)), x1 = hn::Set(d, T(setup.region.x1));
  const auto y0 = hn::Set(d, T(setup.region.y0)), y1 = hn::Set(d, T(setup.region.y1));
  std::size_t count = 0;
  for (std::size_t i = 0; i < n; i += lanes) {
    hn::Vec<decltype(d)> mean[3], log_scale[3], center[3];
    const T* means = gaussians.means + 3 * (begin + i);
    const T* log_scales = gaussians.log_scales + 3 * (begin + i);
    T padded[2][3 * kBlockPixels] = {};
    const std::size_t valid = std::min(lanes, n - i);
    if (valid < lanes) {
      std::memcpy(padded[0], means, 3 * valid * sizeof(T));
      std::memcpy(padded[1], log_scales, 3 * valid * sizeof(T));
      means = padded[0];
      log_scales = padded[1];
    }
    hn::LoadInterleaved3(d, means, mean[0], mean[1], mean[2]);
    hn::LoadInterleaved3(d, log_scales, log_scale[0], log_scale[1], log_scale[2]);
    to_camera(d, setup, mean, center);
    const auto inverse_z = hn::Div(hn::Set(d, T(1)), center[2]);
    const auto tan_x = hn::Mul(center[0], inverse_z);
    const auto tan_y = hn::Mul(center[1], inverse_z);
    const auto clamped_x =
        hn::Clamp(tan_x, hn::Set(d, setup.min_tan_x), hn::Set(d, setup.max_tan_x));
    const auto clamped_y =
        hn::Clamp(tan_y, hn::Set(d, setup.min_tan_y), hn::Set(d, setup.max_tan_y));
    // |J|^2 <= (f / z)^2 (1 + tan_x^2 + tan_y^2) bounds the longest axis in the image.
    const auto secant = hn::Sqrt(
        hn::MulAdd(clamped_x, clamped_x, hn::MulAdd(clamped_y, clamped_y, hn::Set(d, T(1)))));
    const auto largest = hn::Min(hn::Max(hn::Max(log_scale[0], log_scale[1]), log_scale[2]),
                                 hn::Set(d, T(kMaxLogScale)));
    const auto sigma =
        hn::Mul(hn::Mul(hn::Exp(d, largest), secant), hn::Mul(hn::Set(d, focal), inverse_z));
    // Half a pixel and the low-pass filter, by sqrt(a^2 + b) <= a + sqrt(b); 1 % for rounding.
    const auto radius =
        hn::MulAdd(hn::Set(d, T(1.01) * extent), sigma,
                   hn::Set(d, T(1) + T(1.01) * extent * std::sqrt(setup.eps2d_px2)));
    const auto px = hn::MulAdd(tan_x, hn::Set(d, setup.fx), hn::Set(d, setup.cx));
    const auto py = hn::MulAdd(tan_y, hn::Set(d, setup.fy), hn::Set(d, setup.cy));
    auto seen = hn::And(hn::Gt(center[2], hn::Set(d, setup.near_m)), hn::FirstN(d, valid));
    seen = hn::And(seen, hn::And(hn::Gt(hn::Add(px, radius), x0), hn::Lt(hn::Sub(px, radius), x1)));
    seen = hn::And(seen, hn::And(hn::Gt(hn::Add(py, radius), y0), hn::Lt(hn::Sub(py, radius), y1)));
    const auto index = hn::Iota(di, static_cast<Row>(i));
    const auto seen_index = hn::RebindMask(di, seen);
    hn::StoreU(hn::Compress(index, seen_index), di, rows + count);
    count += hn::CountTrue(di, seen_index);
  }
  return count;
}

/// Colours max(min_color, 0.5 + SH) of one Gaussian a lane, seen from the camera.
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

bool touches_wanted(const TileRect& rect, const WantedPixels& wanted, int tiles_x) {
  if (wanted.all()) return true;
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = rect.x0; x < rect.x1; ++x) {
      if (wanted.blocks(y * tiles_x + x)) return true;
    }
  }
  return false;
}

template <typename T>
bool project_chunk(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                   const WantedPixels& wanted, std::size_t chunk, Splats<T>& out) {
  const Lanes<T> d;
  const hn::RebindToSigned<decltype(d)> di;
  using V = hn::Vec<decltype(d)>;
  using Row = hn::TFromD<decltype(di)>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t begin = chunk * kChunkSize;
  const std::size_t n = std::min<std::size_t>(kChunkSize, gaussians.size - begin);
  out.counts[chunk] = 0;
  if (!chunk_is_finite(gaussians, begin, n)) return false;

  Row rows[kChunkSize + 2 * kBlockPixels];
  const std::size_t candidates = cull_chunk(gaussians, setup, begin, n, rows);
  if (candidates == 0) return true;
  // The last vector is filled up with repetitions, which are not stored.
  std::fill(rows + candidates, rows + candidates + lanes, rows[candidates - 1]);

  const GaussianView<T> local = rows_from(gaussians, begin);
  Splat<T>* splats = out.splats.data() + begin;
  SplatKey<T>* keys = out.keys.data() + begin;
  std::size_t stored = 0;
  std::uint64_t areas = 0;
  for (std::size_t i = 0; i < candidates; i += lanes) {
    const Geometry<Lanes<T>> g = project(d, local, setup, rows + i);
    const Whitening<Lanes<T>> white = whitening(d, g);

    V logit;
    gather_rows<1>(d, local.logit_opacities, local.logit_opacities + local.size, 1, rows + i,
                   &logit);
    V opacity = hn::Set(d, T(1)) / (hn::Set(d, T(1)) + hn::Exp(d, hn::Neg(logit)));
    if (setup.antialias) opacity = opacity * hn::Sqrt(g.det / g.filtered_det);
    auto seen = hn::Ge(opacity, hn::Set(d, setup.alpha_min));
    V depth_axes[3];
    for (int k = 0; k < 3; ++k) depth_axes[k] = g.camera_from_gaussian[2][k] * g.scale[k];
    const V nearest = hn::Set(d, setup.near_variances) * dot3<Lanes<T>>(depth_axes, depth_axes);
    seen = hn::And(seen, hn::Gt(g.z * g.z, nearest));
    const V log2_opacity = hn::Log2(d, hn::Max(opacity, hn::Set(d, setup.alpha_min)));

    // Half sizes of the box around the ellipse alpha = alpha_min, a little larger for rounding.
    const V power = log2_opacity - hn::Set(d, setup.log2_alpha_min);
    const V reach = hn::Sqrt(hn::MulAdd(power, hn::Set(d, T(1.001)), hn::Set(d, T(0.001))) *
                             hn::Set(d, T(2 * kLn2))) /
                    g.shrink;
    const V half_x = reach * hn::Sqrt(g.filtered_xx), half_y = reach * hn::Sqrt(g.filtered_yy);
    const V px = hn::MulAdd(g.x_over_z, hn::Set(d, setup.fx), hn::Set(d, setup.cx));
    const V py = hn::MulAdd(g.y_over_z, hn::Set(d, setup.fy), hn::Set(d, setup.cy));
    // First and last pixel whose centre lies in the box, cut to the region.
    const V half = hn::Set(d, T(0.5));
    const V x0 = hn::Max(hn::Ceil(px - half_x - half), hn::Set(d, T(setup.region.x0)));
    const V y0 = hn::Max(hn::Ceil(py - half_y - half), hn::Set(d, T(setup.region.y0)));
    const V x1 = hn::Min(hn::Floor(px + half_x - half), hn::Set(d, T(setup.region.x1 - 1)));
    const V y1 = hn::Min(hn::Floor(py + half_y - half), hn::Set(d, T(setup.region.y1 - 1)));
    seen = hn::And(seen, hn::And(hn::Le(x0, x1), hn::Le(y0, y1)));
    // Footprints beyond the range of T, or without an area when eps2d is 0, are not seen.
    const V all =
        hn::Abs(px) + hn::Abs(py) + half_x + half_y + white.uu + hn::Abs(white.uv) + white.vv;
    seen = hn::And(seen, hn::And(hn::IsFinite(all), hn::Gt(g.filtered_det, hn::Zero(d))));
    if (hn::AllFalse(d, seen)) continue;

    V colors[3];
    evaluate_colors(d, local, setup, rows + i, colors);
    HWY_ALIGN Row box[4][kBlockPixels], flags[kBlockPixels];
    HWY_ALIGN T depths[kBlockPixels];
    const auto store_tile = [&](V pixel, Row* tile) HWY_ATTR {
      hn::Store(hn::ShiftRight<kLog2TileSize>(hn::ConvertTo(di, hn::IfThenElseZero(seen, pixel))),
                di, tile);
    };
    store_tile(x0, box[0]);
    store_tile(y0, box[1]);
    store_tile(x1, box[2]);
    store_tile(y1, box[3]);
    hn::Store(hn::IfThenElseZero(hn::RebindMask(di, seen), hn::Set(di, 1)), di, flags);
    hn::Store(g.z, d, depths);
    // Those not seen are written too, to a place that nobody reads: that spares branches.
    Splat<T> unseen, *places[kBlockPixels] = {};
    const std::size_t count = std::min(lanes, candidates - i);
    for (std::size_t lane = 0; lane < count; ++lane) {
      const TileRect rect = {std::uint16_t(box[0][lane]), std::uint16_t(box[1][lane]),
                             std::uint16_t(box[2][lane] + 1), std::uint16_t(box[3][lane] + 1)};
      const bool kept = flags[lane] && touches_wanted(rect, wanted, setup.tiles_x);
      Splat<T>& splat = kept ? splats[stored] : unseen;
      splat.gaussian = std::uint32_t(begin + std::size_t(rows[i + lane]));
      places[lane] = &splat;
      keys[stored] = {rect, depth_bits(depths[lane])};
      areas += kept ? area(rect) : 0;
      stored += kept;
    }
    const V first[4] = {px, py, white.uu, white.uv};
    const V second[4] = {white.vv, log2_opacity, colors[0], colors[1]};
    const DepthSlant<Lanes<T>> slant = depth_slant(d, setup, g, white);
    const V third[4] = {colors[2], g.z, slant.along_u, slant.along_v};
    store_columns(d, first, count, [&](std::size_t lane) { return &places[lane]->mean_x; });
    store_columns(d, second, count, [&](std::size_t lane) { return &places[lane]->vv; });
    store_columns(d, third, count, [&](std::size_t lane) { return &places[lane]->color[2]; });
  }
  out.counts[chunk] = std::uint32_t(stored);
  out.areas[chunk] = areas;
  return true;
}

bool project_chunk_float(const GaussianView<float>& gaussians, const RenderSetup<float>& setup,
                         const WantedPixels& wanted, std::size_t chunk, Splats<float>& splats) {
  return HWY_NAMESPACE::project_chunk<float>(gaussians, setup, wanted, chunk, splats);
}
bool project_chunk_double(const GaussianView<double>& gaussians, const RenderSetup<double>& setup,
                          const WantedPixels& wanted, std::size_t chunk, Splats<double>& splats) {
  return HWY_NAMESPACE::project_chunk<double>(gaussians, setup, wanted, chunk, splats);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(project_chunk_float);
HWY_EXPORT(project_chunk_double);

template <>
bool project_chunk(const GaussianView<float>& gaussians, const RenderSetup<float>& setup,
                   const WantedPixels& wanted, std::size_t chunk, Splats<float>& splats) {
  return HWY_DYNAMIC_DISPATCH(project_chunk_float)(gaussians, setup, wanted, chunk, splats);
}
template <>
bool project_chunk(const GaussianView<double>& gaussians, const RenderSetup<double>& setup,
                   const WantedPixels& wanted, std::size_t chunk, Splats<double>& splats) {
  return HWY_DYNAMIC_DISPATCH(project_chunk_double)(gaussians, setup, wanted, chunk, splats);
}

}  // namespace gslts::raster
#endif
