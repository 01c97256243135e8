// Gradients of the loss with respect to the blended sums of the pixels of a tile. Included once per
// instruction set.

#if defined(GSLTS_RASTER_PIXEL_GRADIENTS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_PIXEL_GRADIENTS_INL_HPP
#undef GSLTS_RASTER_PIXEL_GRADIENTS_INL_HPP
#else
#define GSLTS_RASTER_PIXEL_GRADIENTS_INL_HPP
#endif

#include <algorithm>

#include "kernels.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Per block, kBlockPixels values of each of these: first the image gradients and then, from them,
/// the gradients with respect to the blended sums; and kBehind, the part of the loss that the
/// splats behind the current one still contribute, sum_{j > i} w_j s_j with s_j = dL/dw_j: all
/// channels collapse into s, one number a pixel.
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

/// Turns the image gradients of one vector of pixels into those of the blended sums, and fills
/// kBehind. The rendered colour is the sum plus (1 - alpha) background, the depth a ratio of sums.
/// @param sums  Of the pixels, as `blend_tile` left them.
/// @param wanted  Other pixels get gradients of 0.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void differentiate_pixels(D d, const RenderSetup<T>& setup, const T* sums,
                                     hn::Mask<D> wanted, std::size_t dims, T* pixel) {
  using V = hn::Vec<D>;
  const V zero = hn::Zero(d);
  V behind = zero;
  const auto put = [&](std::size_t value, std::size_t sum, V gradient) HWY_ATTR {
    gradient = hn::IfThenElseZero(wanted, gradient);
    hn::Store(gradient, d, pixel + value * kBlockPixels);
    behind = hn::MulAdd(gradient, hn::Load(d, sums + sum * kBlockPixels), behind);
  };
  const auto get = [&](std::size_t value)
                       HWY_ATTR { return hn::Load(d, pixel + value * kBlockPixels); };
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

/// Fills `PixelValue` for one tile.
/// @return  false if an image gradient is not finite.
template <typename T>
bool load_pixel_gradients(const TileTask<T>& tile, const RenderSetup<T>& setup,
                          const ImageGradients<T>& image, const T* transmittance, std::size_t dims,
                          T* pixels) {
  const Lanes<T> d;
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
  for (std::size_t block = 0; block < kBlocksPerTile; ++block) {
    for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d)) {
      const auto wanted =
          hn::Gt(hn::Load(d, transmittance + block * kBlockPixels + i), hn::Zero(d));
      differentiate_pixels(d, setup, tile.sums + block * sums_stride + i, wanted, dims,
                           pixels + block * stride + i);
    }
  }
  return true;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
