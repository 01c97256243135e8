#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "blend_backward.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>

#include "blend-inl.hpp"
#include "kernels.hpp"
#include "pixel_gradients-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

// The backward pass of blending (3DGS, Kerbl et al. 2023, eq. 3), front to back: instead of
// dividing the transmittance by 1 - alpha from the back, each pixel keeps what the splats behind
// contribute.

/// The pixels of a tile while its entries are taken one by one.
template <typename T>
struct TilePixels {
  std::size_t dims;    ///< Channels of the features that have a gradient.
  std::size_t stride;  ///< Distance of the values of one block to those of the next.
  T* values;           ///< `PixelValue` by block.
  T* transmittance;
  T* feature_sums;  ///< [dims, kBlockPixels] sums of one entry.
};

/// Gradients of the loss with respect to the blended sums of one vector of pixels.
template <class D>
struct PixelGradients {
  using V = hn::Vec<D>;
  V red, green, blue, depth, alpha;

  template <typename T>
  HWY_INLINE PixelGradients(D d, const T* pixel)
      : red(hn::Load(d, pixel + kRed * kBlockPixels)),
        green(hn::Load(d, pixel + kGreen * kBlockPixels)),
        blue(hn::Load(d, pixel + kBlue * kBlockPixels)),
        depth(hn::Load(d, pixel + kDepth * kBlockPixels)),
        alpha(hn::Load(d, pixel + kAlpha * kBlockPixels)) {}

  /// dL/dw of a splat, all channels but the features.
  HWY_INLINE V weight_gradient(const SplatInLanes<D>& splat, const Footprint<D>& at) const {
    V s = hn::MulAdd(red, splat.red, alpha);
    s = hn::MulAdd(green, splat.green, s);
    s = hn::MulAdd(blue, splat.blue, s);
    return hn::MulAdd(depth, at.depth(splat), s);
  }
};

/// Sums of one splat over the pixels of blocks, kept in registers; see `EntrySum` and
/// kStatisticsPerEntry.
template <class D>
struct SplatSums {
  using V = hn::Vec<D>;
  V g, gu, gv, guu, guv, gvv;
  V red, green, blue, depth, depth_u, depth_v;
  V abs_x, abs_y, max_weight, pixel_count;

  SplatSums() = default;

  HWY_INLINE explicit SplatSums(D d)
      : g(hn::Zero(d)),
        gu(g),
        gv(g),
        guu(g),
        guv(g),
        gvv(g),
        red(g),
        green(g),
        blue(g),
        depth(g),
        depth_u(g),
        depth_v(g),
        abs_x(g),
        abs_y(g),
        max_weight(g),
        pixel_count(g) {}

  HWY_INLINE void add_footprint(V gradient, const Footprint<D>& at) {
    const V by_u = gradient * at.u, by_v = gradient * at.v;
    g = g + gradient;
    gu = gu + by_u;
    gv = gv + by_v;
    guu = hn::MulAdd(by_u, at.u, guu);
    guv = hn::MulAdd(by_u, at.v, guv);
    gvv = hn::MulAdd(by_v, at.v, gvv);
  }

  HWY_INLINE void add_color(V w, const PixelGradients<D>& pixels) {
    red = hn::MulAdd(w, pixels.red, red);
    green = hn::MulAdd(w, pixels.green, green);
    blue = hn::MulAdd(w, pixels.blue, blue);
  }

  HWY_INLINE void add_depth(V dL_dz, const Footprint<D>& at) {
    depth = depth + dL_dz;
    depth_u = hn::MulAdd(dL_dz, at.u, depth_u);
    depth_v = hn::MulAdd(dL_dz, at.v, depth_v);
  }

  /// d(-ln 2 (u^2 + v^2)) / d(mean2d) = 2 ln 2 (uu u, uv u + vv v), and the depth at a pixel moves
  /// against the mean.
  HWY_INLINE void add_statistics(D d, V gradient, V w, V dL_dz, const SplatInLanes<D>& splat,
                                 const Footprint<D>& at) {
    const V two_ln2 = hn::Set(d, hn::TFromD<D>(2 * kLn2));
    const V depth_x = splat.uu * splat.depth_u;  // Change of the depth from pixel to pixel, m.
    const V depth_y = hn::MulAdd(splat.uv, splat.depth_u, splat.vv * splat.depth_v);
    const V by_u = gradient * at.u, by_v = gradient * at.v;
    const V by_x = two_ln2 * (by_u * splat.uu);
    const V by_y = two_ln2 * hn::MulAdd(by_u, splat.uv, by_v * splat.vv);
    abs_x = abs_x + hn::Abs(hn::NegMulAdd(dL_dz, depth_x, by_x));
    abs_y = abs_y + hn::Abs(hn::NegMulAdd(dL_dz, depth_y, by_y));
    max_weight = hn::Max(max_weight, w);
    pixel_count =
        pixel_count + hn::IfThenElseZero(hn::Gt(w, hn::Zero(d)), hn::Set(d, hn::TFromD<D>(1)));
  }
};

/// Adds the features' part of dL/dw to s, and w dL/dfeatures to the sums of the entry.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<D> add_feature_gradient(D d, hn::Vec<D> s, hn::Vec<D> w, const T* pixel,
                                           const T* feature, std::size_t dims, T* feature_sums) {
  for (std::size_t k = 0; k < dims; ++k) {
    const auto g = hn::Load(d, pixel + (kFeatures + k) * kBlockPixels);
    s = hn::MulAdd(g, hn::Set(d, feature[k]), s);
    T* sum = feature_sums + k * kBlockPixels;
    hn::Store(hn::MulAdd(w, g, hn::Load(d, sum)), d, sum);
  }
  return s;
}

/// Differentiates one splat at one vector of pixels, and goes on to the next splat of the pixels.
/// @return  Whether a pixel has not ended.
template <bool kHasFeatures, bool kStatistics, int kExpDegree, class D, typename T>
HWY_INLINE bool differentiate_splat(D d, const RenderSetup<T>& setup, const SplatInLanes<D>& splat,
                                    const T* feature, const PixelCenters<D>& centers,
                                    std::size_t dims, T* pixel, T* transmittance, T* feature_sums,
                                    SplatSums<D>& sums) {
  using V = hn::Vec<D>;
  const Footprint<D> at(splat, centers);
  const V before = hn::Load(d, transmittance);
  const V any_alpha = alpha_at<kExpDegree>(d, at, hn::Set(d, setup.log2_alpha_min));
  const V after = hn::NegMulAdd(any_alpha, before, before);
  hn::Store(after, d, transmittance);
  const auto live = hn::Ge(after, hn::Set(d, setup.transmittance_min));
  const V alpha = hn::IfThenElseZero(live, any_alpha);
  const V w = alpha * before;
  const PixelGradients<D> pixel_gradients(d, pixel);
  V s = pixel_gradients.weight_gradient(splat, at);
  if (kHasFeatures) s = add_feature_gradient(d, s, w, pixel, feature, dims, feature_sums);
  // dL/dlog(alpha_i) = w_i s_i - alpha_i / (1 - alpha_i) sum_{j > i} w_j s_j
  const V behind = hn::NegMulAdd(w, s, hn::Load(d, pixel + kBehind * kBlockPixels));
  hn::Store(behind, d, pixel + kBehind * kBlockPixels);
  const V odds = alpha / (hn::Set(d, T(1)) - alpha);
  // The clamped alpha does not move with the footprint or the opacity.
  const V g = hn::IfThenElseZero(hn::Le(at.log2_alpha, hn::Set(d, T(kLog2MaxAlpha))),
                                 hn::NegMulAdd(odds, behind, w * s));
  const V dL_dz = w * pixel_gradients.depth;
  sums.add_footprint(g, at);
  sums.add_color(w, pixel_gradients);
  sums.add_depth(dL_dz, at);
  if (kStatistics) sums.add_statistics(d, g, w, dL_dz, splat, at);
  return !hn::AllFalse(d, live);
}

/// Stores the sums over the lanes of four members, of which sums[i] holds those of vector i.
template <auto kA, auto kB, auto kC, auto kE, class D, typename T>
HWY_INLINE void store_members(D d, const SplatSums<D>* sums, T* out) {
  hn::Vec<D> a[kVectors<D>], b[kVectors<D>], c[kVectors<D>], e[kVectors<D>];
  for (std::size_t i = 0; i < kVectors<D>; ++i) {
    a[i] = sums[i].*kA, b[i] = sums[i].*kB, c[i] = sums[i].*kC, e[i] = sums[i].*kE;
  }
  store_sums(d, a, b, c, e, out);
}

/// Stores the sums of an entry, of which sums[i] holds those of vector i of the blocks.
template <bool kStatistics, class D, typename T>
HWY_INLINE void store_entry(D d, const SplatSums<D>* sums, std::size_t index,
                            const EntryGradients<T>& out) {
  using S = SplatSums<D>;
  T* entry = out.sums + index * kSumsPerEntry;
  store_members<&S::g, &S::gu, &S::gv, &S::guu>(d, sums, entry);
  store_members<&S::guv, &S::gvv, &S::red, &S::green>(d, sums, entry + kSumUV);
  store_members<&S::blue, &S::depth, &S::depth_u, &S::depth_v>(d, sums, entry + kSumBlue);
  if (!kStatistics) return;
  T* statistics = out.statistics + index * kStatisticsPerEntry;
  // The third, of which there is no sum, is overwritten.
  store_members<&S::abs_x, &S::abs_y, &S::pixel_count, &S::pixel_count>(d, sums, statistics);
  auto max_weight = sums[0].max_weight;
  for (std::size_t i = 1; i < kVectors<D>; ++i)
    max_weight = hn::Max(max_weight, sums[i].max_weight);
  statistics[2] = hn::GetLane(hn::MaxOfLanes(d, max_weight));
}

/// Sets the sums of an entry that touches no pixel to 0.
template <bool kStatistics, typename T>
void clear_entry(std::size_t index, std::size_t dims, const EntryGradients<T>& out) {
  std::fill_n(out.sums + index * kSumsPerEntry, kSumsPerEntry, T(0));
  std::fill_n(out.features + index * dims, dims, T(0));
  if (kStatistics) {
    std::fill_n(out.statistics + index * kStatisticsPerEntry, kStatisticsPerEntry, T(0));
  }
}

/// Differentiates one splat at all pixels of some blocks, and stores its sums.
/// @return  Bits of the blocks with a pixel that has not ended.
template <bool kHasFeatures, bool kStatistics, int kExpDegree, typename T>
HWY_INLINE std::uint64_t differentiate_entry(const TileTask<T>& tile, const RenderSetup<T>& setup,
                                             const Splat<T>& stored, const T* feature,
                                             std::uint64_t blocks, std::size_t index,
                                             const TilePixels<T>& pixels,
                                             const EntryGradients<T>& out) {
  const Lanes<T> d;
  const SplatInLanes<Lanes<T>> splat(d, stored, tile.x, tile.y);
  std::fill_n(pixels.feature_sums, pixels.dims * kBlockPixels, T(0));
  std::uint64_t alive = 0;
  // One vector of each block after the other: the sums of two vectors of AVX2 would not fit the
  // registers.
  SplatSums<Lanes<T>> sums[kVectors<Lanes<T>>];
  for (std::size_t part = 0; part < kVectors<Lanes<T>>; ++part) {
    const std::size_t i = part * hn::Lanes(d);
    SplatSums<Lanes<T>> part_sums(d);
    for (std::uint64_t left = blocks; left; left &= left - 1) {
      const std::size_t block = hwy::Num0BitsBelowLS1Bit_Nonzero64(left);
      const PixelCenters<Lanes<T>> centers(d, block, part);
      const bool goes_on = differentiate_splat<kHasFeatures, kStatistics, kExpDegree>(
          d, setup, splat, feature, centers, pixels.dims, pixels.values + block * pixels.stride + i,
          pixels.transmittance + block * kBlockPixels + i, pixels.feature_sums + i, part_sums);
      if (goes_on) alive |= std::uint64_t{1} << block;
    }
    sums[part] = part_sums;
  }
  store_entry<kStatistics>(d, sums, index, out);
  for (std::size_t k = 0; k < pixels.dims; ++k) {
    out.features[index * pixels.dims + k] = sum_of_pixels(pixels.feature_sums + k * kBlockPixels);
  }
  return alive;
}

template <bool kHasFeatures, bool kStatistics, int kExpDegree, typename T>
bool blend_entries_backward(const TileTask<T>& tile, const RenderSetup<T>& setup,
                            const Splat<T>* splats, const T* features, const WantedPixels& wanted,
                            const ImageGradients<T>& image_gradients,
                            const EntryGradients<T>& out) {
  const std::size_t dims = kHasFeatures ? std::size_t(setup.feature_dims) : 0;
  const std::size_t stride = (kFeatures + dims) * kBlockPixels;
  static thread_local Array<T> values, feature_sums;
  values.resize(kBlocksPerTile * stride);
  feature_sums.resize(dims * kBlockPixels);
  HWY_ALIGN T transmittance[kBlocksPerTile * kBlockPixels];
  const TilePixels<T> pixels = {dims, stride, values.data(), transmittance, feature_sums.data()};
  std::uint64_t alive = start_transmittance(tile, setup, wanted, transmittance);
  if (!load_pixel_gradients(tile, setup, image_gradients, transmittance, dims, pixels.values)) {
    return false;
  }
  for (std::uint32_t e = 0; e < tile.count; ++e) {
    if (e + kBlendPrefetch < *tile.reached) {
      const TileEntry<T>& ahead = tile.entries[e + kBlendPrefetch];
      __builtin_prefetch(splats + ahead.slot);
      __builtin_prefetch(out.sums + std::size_t(ahead.gradient) * kSumsPerEntry, 1);
    }
    const TileEntry<T>& entry = tile.entries[e];
    const std::uint64_t blocks = e < *tile.reached ? tile.blocks[e] & alive : 0;
    if (!blocks) {
      clear_entry<kStatistics>(entry.gradient, dims, out);
      continue;
    }
    const Splat<T>& splat = splats[entry.slot];
    const T* feature = features + std::size_t(splat.gaussian) * setup.feature_dims;
    alive &= ~blocks | differentiate_entry<kHasFeatures, kStatistics, kExpDegree>(
                           tile, setup, splat, feature, blocks, entry.gradient, pixels, out);
  }
  return true;
}

template <int kExpDegree, typename T>
auto entries_backward(bool features, bool statistics) {
  if (features) {
    return statistics ? &blend_entries_backward<true, true, kExpDegree, T>
                      : &blend_entries_backward<true, false, kExpDegree, T>;
  }
  return statistics ? &blend_entries_backward<false, true, kExpDegree, T>
                    : &blend_entries_backward<false, false, kExpDegree, T>;
}

template <typename T>
bool blend_tile_backward(const TileTask<T>& tile, const RenderSetup<T>& setup,
                         const Splat<T>* splats, const T* features, const WantedPixels& wanted,
                         const ImageGradients<T>& image_gradients, const EntryGradients<T>& out) {
  const auto blend = setup.exp_degree == 3 ? entries_backward<3, T>(out.features, out.statistics)
                                           : entries_backward<5, T>(out.features, out.statistics);
  return blend(tile, setup, splats, features, wanted, image_gradients, out);
}

auto blend_tile_backward_float() { return &HWY_NAMESPACE::blend_tile_backward<float>; }
auto blend_tile_backward_double() { return &HWY_NAMESPACE::blend_tile_backward<double>; }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(blend_tile_backward_float);
HWY_EXPORT(blend_tile_backward_double);

template <>
bool blend_tile_backward(const TileTask<float>& tile, const RenderSetup<float>& setup,
                         const Splat<float>* splats, const float* features,
                         const WantedPixels& wanted, const ImageGradients<float>& gradients,
                         const EntryGradients<float>& out) {
  return HWY_DYNAMIC_DISPATCH(blend_tile_backward_float)()(tile, setup, splats, features, wanted,
                                                           gradients, out);
}
template <>
bool blend_tile_backward(const TileTask<double>& tile, const RenderSetup<double>& setup,
                         const Splat<double>* splats, const double* features,
                         const WantedPixels& wanted, const ImageGradients<double>& gradients,
                         const EntryGradients<double>& out) {
  return HWY_DYNAMIC_DISPATCH(blend_tile_backward_double)()(tile, setup, splats, features, wanted,
                                                            gradients, out);
}

}  // namespace gslts::raster
#endif
