#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "blend_backward.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <vector>

#include "blend-inl.hpp"
#include "kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

// Per block, kBlockPixels values of each of these: the transposed image gradients and, from them,
// the gradient of the loss with respect to the blended sums and the part of the loss that the
// splats behind the current one still contribute, sum_{j > i} w_j s_j with s_j = dL/dw_j: all
// channels collapse into s, one number a pixel.
enum PixelValue { kBehind, kRed, kGreen, kBlue, kDepth, kAlpha, kFeatures };

/// Copies `channels` interleaved channels of the tile's part of an image into the tile's blocks.
template <typename T>
void load_tile(const TileTask<T>& tile, const RenderSetup<T>& setup, const T* image,
               std::size_t channels, std::size_t block_stride, T* out) {
  if (!image) return;
  const int x0 = tile.x * kTileSize, y0 = tile.y * kTileSize;
  const int width = std::min(kTileSize, setup.width - x0);
  const int height = std::min(kTileSize, setup.height - y0);
  const hn::CappedTag<T, kBlockSize> d;
  const int lanes = int(hn::Lanes(d));
  for (int y = 0; y < height; ++y) {
    const T* row = image + (std::size_t(y0 + y) * setup.width + x0) * channels;
    T* blocks = out + y / kBlockSize * kBlocksPerRow * block_stride + y % kBlockSize * kBlockSize;
    int x = 0;
    for (; (channels == 1 || channels == 3) && x + lanes <= width; x += lanes) {
      T* pixel = blocks + x / kBlockSize * block_stride + x % kBlockSize;
      if (channels == 1) {
        hn::Store(hn::LoadU(d, row + x), d, pixel);
        continue;
      }
      hn::Vec<hn::CappedTag<T, kBlockSize>> red, green, blue;
      hn::LoadInterleaved3(d, row + 3 * x, red, green, blue);
      hn::Store(red, d, pixel);
      hn::Store(green, d, pixel + kBlockPixels);
      hn::Store(blue, d, pixel + 2 * kBlockPixels);
    }
    for (; x < width; ++x) {
      T* pixel = blocks + x / kBlockSize * block_stride + x % kBlockSize;
      for (std::size_t c = 0; c < channels; ++c) pixel[c * kBlockPixels] = row[x * channels + c];
    }
  }
}

/// Fills the values above for one tile. Returns false if an image gradient is not finite.
template <typename T>
bool load_image_gradients(const TileTask<T>& tile, const RenderSetup<T>& setup,
                          const ImageGradients<T>& image, const T* transmittance, std::size_t dims,
                          T* pixels) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t stride = (kFeatures + dims) * kBlockPixels;
  const std::size_t sums_stride = std::size_t(5 + setup.feature_dims) * kBlockPixels;
  std::fill(pixels, pixels + kBlocksPerTile * stride, T(0));
  load_tile<T>(tile, setup, image.dL_drgb, 3, stride, pixels + kRed * kBlockPixels);
  load_tile<T>(tile, setup, image.dL_ddepth, 1, stride, pixels + kDepth * kBlockPixels);
  load_tile<T>(tile, setup, image.dL_dalpha, 1, stride, pixels + kAlpha * kBlockPixels);
  if (dims) {
    load_tile(tile, setup, image.dL_dfeatures, dims, stride, pixels + kFeatures * kBlockPixels);
  }
  if (!all_finite(pixels, kBlocksPerTile * stride)) return false;
  if (tile.count == 0) return true;

  const V zero = hn::Zero(d);
  for (std::size_t block = 0; block < kBlocksPerTile; ++block) {
    for (std::size_t i = 0; i < kBlockPixels; i += lanes) {
      T* pixel = pixels + block * stride + i;
      const T* sums = tile.sums + block * sums_stride + i;
      const auto wanted = hn::Gt(hn::Load(d, transmittance + block * kBlockPixels + i), zero);
      V behind = zero;
      const auto put = [&](std::size_t value, std::size_t sum, V gradient) HWY_ATTR {
        gradient = hn::IfThenElseZero(wanted, gradient);
        hn::Store(gradient, d, pixel + value * kBlockPixels);
        behind = hn::MulAdd(gradient, hn::Load(d, sums + sum * kBlockPixels), behind);
      };
      const auto get = [&](std::size_t value)
                           HWY_ATTR { return hn::Load(d, pixel + value * kBlockPixels); };
      // The rendered colour is the sum plus (1 - alpha) background, the depth a ratio of sums.
      V by_alpha = get(kAlpha);
      for (std::size_t c = 0; c < 3; ++c) {
        const V gradient = get(kRed + c);
        by_alpha = hn::NegMulAdd(gradient, hn::Set(d, setup.background[c]), by_alpha);
        put(kRed + c, c, gradient);
      }
      const V alpha = hn::Load(d, sums + 4 * kBlockPixels);
      const V inverse_alpha = hn::IfThenElseZero(hn::Gt(alpha, zero), hn::Set(d, T(1)) / alpha);
      const V depth = hn::Load(d, sums + 3 * kBlockPixels) * inverse_alpha;
      const V depth_gradient = get(kDepth) * inverse_alpha;
      by_alpha = hn::NegMulAdd(depth_gradient, depth, by_alpha);
      put(kDepth, 3, depth_gradient);
      put(kAlpha, 4, by_alpha);
      for (std::size_t k = 0; k < dims; ++k) put(kFeatures + k, 5 + k, get(kFeatures + k));
      hn::Store(behind, d, pixel + kBehind * kBlockPixels);
    }
  }
  return true;
}

template <bool kHasFeatures, bool kStatistics, int kExpDegree, typename T>
bool blend_entries_backward(const TileTask<T>& tile, const RenderSetup<T>& setup,
                            const Splat<T>* splats, const T* features, const WantedPixels& wanted,
                            const ImageGradients<T>& image_gradients,
                            const EntryGradients<T>& out) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t dims = kHasFeatures ? std::size_t(setup.feature_dims) : 0;
  const std::size_t stride = (kFeatures + dims) * kBlockPixels;
  static thread_local Array<T> pixel_values, feature_sums;
  pixel_values.resize(kBlocksPerTile * stride);
  feature_sums.resize(dims * kBlockPixels);
  T* pixels = pixel_values.data();

  HWY_ALIGN T transmittance[kBlocksPerTile * kBlockPixels];
  std::uint64_t alive = start_transmittance(tile, setup, wanted, transmittance);
  if (!load_image_gradients(tile, setup, image_gradients, transmittance, dims, pixels)) {
    return false;
  }

  const V zero = hn::Zero(d), one = hn::Set(d, T(1)), two_ln2 = hn::Set(d, T(2 * kLn2));
  const V clamp = hn::Set(d, T(kLog2MaxAlpha));
  const V threshold = hn::Set(d, setup.log2_alpha_min);
  const V transmittance_min = hn::Set(d, setup.transmittance_min);
  for (std::uint32_t entry = 0; entry < tile.count; ++entry) {
    if (entry + kPrefetchDistance < *tile.reached) {
      const TileEntry<T>& ahead = tile.entries[entry + kPrefetchDistance];
      __builtin_prefetch(splats + ahead.slot);
      __builtin_prefetch(out.sums + std::size_t(ahead.gradient) * kSumsPerEntry, 1);
    }
    const std::size_t place = tile.entries[entry].gradient;
    T* sums = out.sums + place * kSumsPerEntry;
    const std::uint64_t blocks = entry < *tile.reached ? tile.blocks[entry] & alive : 0;
    if (!blocks) {
      std::fill(sums, sums + kSumsPerEntry, T(0));
      std::fill_n(out.features + place * dims, dims, T(0));
      if (kStatistics) {
        std::fill_n(out.statistics + place * kStatisticsPerEntry, kStatisticsPerEntry, T(0));
      }
      continue;
    }
    const Splat<T>& splat = splats[tile.entries[entry].slot];
    const V uu = hn::Set(d, splat.uu), uv = hn::Set(d, splat.uv), vv = hn::Set(d, splat.vv);
    const V log2_opacity = hn::Set(d, splat.log2_opacity);
    V corner_u, corner_v;
    corner_uv(d, hn::Set(d, splat.mean_x), hn::Set(d, splat.mean_y), uu, uv, vv, tile.x, tile.y,
              corner_u, corner_v);
    const V red = hn::Set(d, splat.color[0]), green = hn::Set(d, splat.color[1]);
    const V blue = hn::Set(d, splat.color[2]), depth = hn::Set(d, splat.depth);
    const V depth_u = hn::Set(d, splat.depth_u), depth_v = hn::Set(d, splat.depth_v);
    // Of the depth from pixel to pixel.
    const V depth_x = uu * depth_u, depth_y = hn::MulAdd(uv, depth_u, vv * depth_v);
    const T* feature = features + std::size_t(splat.gaussian) * setup.feature_dims;
    // Partial sums of a vector of pixels are added up over the blocks in registers, one vector of
    // each block after the other: two of AVX2 would not fit.
    constexpr std::size_t kParts = kVectors<Lanes<T>>;
    V g_sums[kParts], gu_sums[kParts], gv_sums[kParts];
    V guu_sums[kParts], guv_sums[kParts], gvv_sums[kParts];
    V red_sums[kParts], green_sums[kParts], blue_sums[kParts];
    V depth_sums[kParts], depth_u_sums[kParts], depth_v_sums[kParts];
    V abs_x_sums[kParts], abs_y_sums[kParts], zeros[kParts], pixel_counts[kParts];
    V max_weight = zero;
    std::fill(feature_sums.begin(), feature_sums.end(), T(0));
    std::uint64_t still_alive = 0;
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t i = part * lanes;
      V g_sum = zero, gu_sum = zero, gv_sum = zero, guu_sum = zero, guv_sum = zero, gvv_sum = zero;
      V red_sum = zero, green_sum = zero, blue_sum = zero, depth_sum = zero;
      V depth_u_sum = zero, depth_v_sum = zero, abs_x_sum = zero, abs_y_sum = zero;
      V pixel_count = zero;
      for (std::uint64_t left = blocks; left; left &= left - 1) {
        const std::size_t block = hwy::Num0BitsBelowLS1Bit_Nonzero64(left);
        T* pixel = pixels + block * stride + i;
        const auto value = [&](std::size_t which)
                               HWY_ATTR { return hn::Load(d, pixel + which * kBlockPixels); };
        T* t = transmittance + block * kBlockPixels + i;
        const PixelCenters<Lanes<T>> centers(d, block, part);
        const Footprint<Lanes<T>> at(corner_u, corner_v, uu, uv, vv, log2_opacity, centers);
        const V before = hn::Load(d, t);
        const V any_alpha = hn::IfThenElseZero(hn::Ge(at.log2_alpha, threshold),
                                               alpha_of<kExpDegree>(at.log2_alpha));
        const V after = hn::NegMulAdd(any_alpha, before, before);
        hn::Store(after, d, t);
        const auto live = hn::Ge(after, transmittance_min);
        const V alpha = hn::IfThenElseZero(live, any_alpha);
        const V w = alpha * before;

        const V g_red = value(kRed), g_green = value(kGreen), g_blue = value(kBlue);
        const V g_depth = value(kDepth);
        V s = hn::MulAdd(g_red, red, value(kAlpha));
        s = hn::MulAdd(g_green, green, s);
        s = hn::MulAdd(g_blue, blue, s);
        const V z = hn::MulAdd(depth_u, at.u, hn::MulAdd(depth_v, at.v, depth));
        s = hn::MulAdd(g_depth, z, s);
        for (std::size_t k = 0; k < dims; ++k) {
          const V g = value(kFeatures + k);
          s = hn::MulAdd(g, hn::Set(d, feature[k]), s);
          T* sum = feature_sums.data() + k * kBlockPixels + i;
          hn::Store(hn::MulAdd(w, g, hn::Load(d, sum)), d, sum);
        }
        // dL/dlog(alpha_i) = w_i s_i - alpha_i / (1 - alpha_i) sum_{j > i} w_j s_j
        const V behind = hn::NegMulAdd(w, s, value(kBehind));
        hn::Store(behind, d, pixel + kBehind * kBlockPixels);
        const V odds = alpha / (one - alpha);
        // The clamped alpha does not move with the footprint or the opacity.
        const V g =
            hn::IfThenElseZero(hn::Le(at.log2_alpha, clamp), hn::NegMulAdd(odds, behind, w * s));
        const V gu = g * at.u, gv = g * at.v;
        g_sum = g_sum + g;
        gu_sum = gu_sum + gu;
        gv_sum = gv_sum + gv;
        guu_sum = hn::MulAdd(gu, at.u, guu_sum);
        guv_sum = hn::MulAdd(gu, at.v, guv_sum);
        gvv_sum = hn::MulAdd(gv, at.v, gvv_sum);
        red_sum = hn::MulAdd(w, g_red, red_sum);
        green_sum = hn::MulAdd(w, g_green, green_sum);
        blue_sum = hn::MulAdd(w, g_blue, blue_sum);
        const V by_z = w * g_depth;
        depth_sum = depth_sum + by_z;
        depth_u_sum = hn::MulAdd(by_z, at.u, depth_u_sum);
        depth_v_sum = hn::MulAdd(by_z, at.v, depth_v_sum);
        if (kStatistics) {
          // d(-ln 2 (u^2 + v^2)) / d(mean2d) = 2 ln 2 (uu u, uv u + vv v), and the depth at a pixel
          // moves against the mean.
          const V by_x = two_ln2 * (gu * uu), by_y = two_ln2 * hn::MulAdd(gu, uv, gv * vv);
          abs_x_sum = abs_x_sum + hn::Abs(hn::NegMulAdd(by_z, depth_x, by_x));
          abs_y_sum = abs_y_sum + hn::Abs(hn::NegMulAdd(by_z, depth_y, by_y));
          max_weight = hn::Max(max_weight, w);
          pixel_count = pixel_count + hn::IfThenElseZero(hn::Gt(w, zero), one);
        }
        if (!hn::AllFalse(d, live)) still_alive |= std::uint64_t{1} << block;
      }
      g_sums[part] = g_sum, gu_sums[part] = gu_sum, gv_sums[part] = gv_sum;
      guu_sums[part] = guu_sum, guv_sums[part] = guv_sum, gvv_sums[part] = gvv_sum;
      red_sums[part] = red_sum, green_sums[part] = green_sum, blue_sums[part] = blue_sum;
      depth_sums[part] = depth_sum, depth_u_sums[part] = depth_u_sum;
      depth_v_sums[part] = depth_v_sum;
      abs_x_sums[part] = abs_x_sum, abs_y_sums[part] = abs_y_sum, zeros[part] = zero;
      pixel_counts[part] = pixel_count;
    }
    alive &= ~blocks | still_alive;
    store_sums(d, g_sums, gu_sums, gv_sums, guu_sums, sums);
    store_sums(d, guv_sums, gvv_sums, red_sums, green_sums, sums + 4);
    store_sums(d, blue_sums, depth_sums, depth_u_sums, depth_v_sums, sums + 8);
    if (kStatistics) {
      T* statistics = out.statistics + place * kStatisticsPerEntry;
      store_sums(d, abs_x_sums, abs_y_sums, zeros, pixel_counts, statistics);
      statistics[2] = hn::GetLane(hn::MaxOfLanes(d, max_weight));
    }
    for (std::size_t k = 0; k < dims; ++k) {
      out.features[place * dims + k] = sum_of_pixels(feature_sums.data() + k * kBlockPixels);
    }
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

bool blend_tile_backward_float(const TileTask<float>& tile, const RenderSetup<float>& setup,
                               const Splat<float>* splats, const float* features,
                               const WantedPixels& wanted, const ImageGradients<float>& gradients,
                               const EntryGradients<float>& out) {
  return HWY_NAMESPACE::blend_tile_backward<float>(tile, setup, splats, features, wanted, gradients,
                                                   out);
}
bool blend_tile_backward_double(const TileTask<double>& tile, const RenderSetup<double>& setup,
                                const Splat<double>* splats, const double* features,
                                const WantedPixels& wanted, const ImageGradients<double>& gradients,
                                const EntryGradients<double>& out) {
  return HWY_NAMESPACE::blend_tile_backward<double>(tile, setup, splats, features, wanted,
                                                    gradients, out);
}

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
  return HWY_DYNAMIC_DISPATCH(blend_tile_backward_float)(tile, setup, splats, features, wanted,
                                                         gradients, out);
}
template <>
bool blend_tile_backward(const TileTask<double>& tile, const RenderSetup<double>& setup,
                         const Splat<double>* splats, const double* features,
                         const WantedPixels& wanted, const ImageGradients<double>& gradients,
                         const EntryGradients<double>& out) {
  return HWY_DYNAMIC_DISPATCH(blend_tile_backward_double)(tile, setup, splats, features, wanted,
                                                          gradients, out);
}

}  // namespace gslts::raster
#endif
