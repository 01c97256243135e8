#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "projection.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "color-inl.hpp"
#include "culling-inl.hpp"
#include "kernels.hpp"
#include "whitening-inl.hpp"

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

/// Computes the opacities o = sigmoid(logit), with antialias times sqrt(det(C) / det(C + eps2d I))
/// (Mip-Splatting, Yu et al. 2024, eq. 9).
template <class D, typename T, typename Row>
HWY_INLINE hn::Vec<D> activate_opacities(D d, const GaussianView<T>& gaussians,
                                         const RenderSetup<T>& setup, const Row* rows,
                                         const Geometry<D>& g) {
  hn::Vec<D> logit;
  gather_rows<1>(d, gaussians.logit_opacities, gaussians.logit_opacities + gaussians.size, 1, rows,
                 &logit);
  const auto one = hn::Set(d, T(1));
  const auto opacity = one / (one + hn::Exp(d, hn::Neg(logit)));
  return setup.antialias ? opacity * hn::Sqrt(g.det / g.filtered_det) : opacity;
}

/// Tests whether the centre is more than near_sigmas standard deviations of depth before the
/// camera.
template <class D, typename T>
HWY_INLINE hn::Mask<D> clears_camera(D d, const RenderSetup<T>& setup, const Geometry<D>& g) {
  hn::Vec<D> axes[3];
  depth_axes(g, axes);
  return hn::Gt(g.z * g.z, hn::Set(d, setup.near_variances) * dot3<D>(axes, axes));
}

/// A vector of splats, one per lane.
template <class D>
struct SplatLanes {
  using V = hn::Vec<D>;
  V mean_x, mean_y;  ///< px
  Whitening<D> white;
  V log2_opacity;
  V colors[3];
  V depth;  ///< m
  V depth_u, depth_v;
  V x0, y0, x1, y1;  ///< First and last pixel, cut to the region.
  hn::Mask<D> seen;
};

/// Finds the pixels whose centres lie in the box around the ellipse alpha = alpha_min.
template <class D, typename T>
HWY_INLINE void bound_pixels(D d, const RenderSetup<T>& setup, const Geometry<D>& g,
                             SplatLanes<D>& s) {
  using V = hn::Vec<D>;
  // Half sizes of the box, a little larger for rounding.
  const V power = s.log2_opacity - hn::Set(d, setup.log2_alpha_min);
  const V reach = hn::Sqrt(enlarge(d, power) * hn::Set(d, T(2 * kLn2))) / g.shrink;
  const V half_x = reach * hn::Sqrt(g.filtered_xx), half_y = reach * hn::Sqrt(g.filtered_yy);
  const V half = hn::Set(d, T(0.5));
  s.x0 = hn::Max(hn::Ceil(s.mean_x - half_x - half), hn::Set(d, T(setup.region.x0)));
  s.y0 = hn::Max(hn::Ceil(s.mean_y - half_y - half), hn::Set(d, T(setup.region.y0)));
  s.x1 = hn::Min(hn::Floor(s.mean_x + half_x - half), hn::Set(d, T(setup.region.x1 - 1)));
  s.y1 = hn::Min(hn::Floor(s.mean_y + half_y - half), hn::Set(d, T(setup.region.y1 - 1)));
  s.seen = hn::And(s.seen, hn::And(hn::Le(s.x0, s.x1), hn::Le(s.y0, s.y1)));
  // Footprints beyond the range of T, or without an area when eps2d is 0, are not seen.
  const V all = hn::Abs(s.mean_x) + hn::Abs(s.mean_y) + half_x + half_y + s.white.uu +
                hn::Abs(s.white.uv) + s.white.vv;
  s.seen = hn::And(s.seen, hn::And(hn::IsFinite(all), hn::Gt(g.filtered_det, hn::Zero(d))));
}

/// Projects one Gaussian a lane; colours and depths are computed only if one is seen.
template <class D, typename T, typename Row>
HWY_INLINE SplatLanes<D> project_splats(D d, const GaussianView<T>& gaussians,
                                        const RenderSetup<T>& setup, const Row* rows) {
  SplatLanes<D> s;
  const Geometry<D> g = project(d, gaussians, setup, rows);
  s.white = whitening(d, g);
  s.mean_x = hn::MulAdd(g.x_over_z, hn::Set(d, setup.fx), hn::Set(d, setup.cx));
  s.mean_y = hn::MulAdd(g.y_over_z, hn::Set(d, setup.fy), hn::Set(d, setup.cy));
  const auto alpha_min = hn::Set(d, setup.alpha_min);
  const auto opacity = activate_opacities(d, gaussians, setup, rows, g);
  s.log2_opacity = hn::Log2(d, hn::Max(opacity, alpha_min));
  s.seen = hn::And(hn::Ge(opacity, alpha_min), clears_camera(d, setup, g));
  bound_pixels(d, setup, g, s);
  if (hn::AllFalse(d, s.seen)) return s;
  evaluate_colors(d, gaussians, setup, rows, s.colors);
  const DepthSlant<D> slant = depth_slant(d, setup, g, s.white);
  s.depth = g.z;
  s.depth_u = slant.along_u;
  s.depth_v = slant.along_v;
  return s;
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

/// The slots of a chunk that are filled so far.
template <typename T>
struct ChunkSlots {
  Splat<T>* splats;
  SplatKey<T>* keys;
  std::size_t count = 0;
  std::uint64_t area = 0;  ///< Sum of the areas of their rectangles, in tiles.
};

/// Finds the tiles of the first `count` splats, and stores the keys of those that are seen.
/// @param splats  Receives where each splat is to be stored: in the next slot, or in `unseen`,
/// which
///   nobody reads: that spares branches.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_keys(D d, const SplatLanes<D>& s, const RenderSetup<T>& setup,
                           const WantedPixels& wanted, std::size_t count, ChunkSlots<T>& slots,
                           Splat<T>* unseen, Splat<T>** splats) {
  const hn::RebindToSigned<D> di;
  using Tile = hn::TFromD<decltype(di)>;
  HWY_ALIGN Tile box[4][kBlockPixels], seen[kBlockPixels];
  HWY_ALIGN T depths[kBlockPixels];
  const auto store_tile = [&](hn::Vec<D> pixel, Tile* tile) HWY_ATTR {
    hn::Store(hn::ShiftRight<kLog2TileSize>(hn::ConvertTo(di, hn::IfThenElseZero(s.seen, pixel))),
              di, tile);
  };
  store_tile(s.x0, box[0]);
  store_tile(s.y0, box[1]);
  store_tile(s.x1, box[2]);
  store_tile(s.y1, box[3]);
  hn::Store(hn::IfThenElseZero(hn::RebindMask(di, s.seen), hn::Set(di, 1)), di, seen);
  hn::Store(s.depth, d, depths);
  for (std::size_t lane = 0; lane < count; ++lane) {
    const TileRect rect = {std::uint16_t(box[0][lane]), std::uint16_t(box[1][lane]),
                           std::uint16_t(box[2][lane] + 1), std::uint16_t(box[3][lane] + 1)};
    const bool kept = seen[lane] && touches_wanted(rect, wanted, setup.tiles_x);
    splats[lane] = kept ? slots.splats + slots.count : unseen;
    slots.keys[slots.count] = {rect, depth_bits(depths[lane])};
    slots.area += kept ? area(rect) : 0;
    slots.count += kept;
  }
}

template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_splats(D d, const SplatLanes<D>& s, std::size_t count, Splat<T>** splats) {
  const hn::Vec<D> first[4] = {s.mean_x, s.mean_y, s.white.uu, s.white.uv};
  const hn::Vec<D> second[4] = {s.white.vv, s.log2_opacity, s.colors[0], s.colors[1]};
  const hn::Vec<D> third[4] = {s.colors[2], s.depth, s.depth_u, s.depth_v};
  store_columns(d, first, count, [&](std::size_t lane) { return &splats[lane]->mean_x; });
  store_columns(d, second, count, [&](std::size_t lane) { return &splats[lane]->vv; });
  store_columns(d, third, count, [&](std::size_t lane) { return &splats[lane]->color[2]; });
}

template <typename T>
bool project_chunk(const GaussianView<T>& gaussians, const RenderSetup<T>& setup,
                   const WantedPixels& wanted, std::size_t index, Splats<T>& out) {
  const Lanes<T> d;
  using Row = hn::TFromD<hn::RebindToSigned<decltype(d)>>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t begin = out.chunks[index] * kChunkSize, first_slot = index * kChunkSize;
  const std::size_t n = std::min(kChunkSize, gaussians.size - begin);
  out.counts[index] = 0;
  if (!gaussians.bounds && !chunk_is_finite(gaussians, begin, n)) return false;

  Row rows[kChunkSize + 2 * kBlockPixels];
  const std::size_t candidates = cull_chunk(gaussians, setup, begin, n, rows);
  if (candidates == 0) return true;
  // The last vector is filled up with repetitions, which are not stored.
  std::fill(rows + candidates, rows + candidates + lanes, rows[candidates - 1]);

  const GaussianView<T> chunk_rows = rows_from(gaussians, begin);
  ChunkSlots<T> slots = {out.splats.data() + first_slot, out.keys.data() + first_slot};
  for (std::size_t i = 0; i < candidates; i += lanes) {
    const SplatLanes<Lanes<T>> s = project_splats(d, chunk_rows, setup, rows + i);
    if (hn::AllFalse(d, s.seen)) continue;
    const std::size_t count = std::min(lanes, candidates - i);
    Splat<T> unseen, *splats[kBlockPixels] = {};
    store_keys(d, s, setup, wanted, count, slots, &unseen, splats);
    for (std::size_t lane = 0; lane < count; ++lane) {
      splats[lane]->gaussian = std::uint32_t(begin + std::size_t(rows[i + lane]));
    }
    store_splats(d, s, count, splats);
  }
  out.counts[index] = std::uint32_t(slots.count);
  out.areas[index] = slots.area;
  return true;
}

auto project_chunk_float() { return &HWY_NAMESPACE::project_chunk<float>; }
auto project_chunk_double() { return &HWY_NAMESPACE::project_chunk<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(project_chunk_float);
HWY_EXPORT(project_chunk_double);

template <>
bool project_chunk(const GaussianView<float>& gaussians, const RenderSetup<float>& setup,
                   const WantedPixels& wanted, std::size_t index, Splats<float>& splats) {
  return HWY_DYNAMIC_DISPATCH(project_chunk_float)()(gaussians, setup, wanted, index, splats);
}
template <>
bool project_chunk(const GaussianView<double>& gaussians, const RenderSetup<double>& setup,
                   const WantedPixels& wanted, std::size_t index, Splats<double>& splats) {
  return HWY_DYNAMIC_DISPATCH(project_chunk_double)()(gaussians, setup, wanted, index, splats);
}

}  // namespace gslts::raster
#endif
