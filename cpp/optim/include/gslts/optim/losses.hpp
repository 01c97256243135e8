#pragma once

#include <array>
#include <cstddef>

#include "gslts/map/array.hpp"
#include "gslts/raster/rasterizer.hpp"

// Losses of a rendered image against a measured one, with their gradients with respect to the
// rendered one. Each is a mean over the pixels that count, so that a mask changes which pixels are
// compared and not how much the loss weighs; if none counts, value and gradient are 0. Results are
// bit-identical for any thread count.

namespace gslts::optim {

/// Colour correction of one image, per channel: observed = gain * rendered + offset.
struct Exposure {
  std::array<double, 3> gain{1.0, 1.0, 1.0};
  std::array<double, 3> offset{0.0, 0.0, 0.0};
};

/// Fits the exposure over the wanted pixels by least squares, in closed form. A channel in which
/// the rendering is constant has gain 1.
/// @param rgb, target  [H,W,3] rendered and observed colours.
/// @param mask  Wanted pixels.
/// @param threads  0 means one per hardware thread.
/// @throws std::invalid_argument  if the mask has another size, or a wanted number is not finite.
template <typename T>
Exposure fit_exposure(const T* rgb, const T* target, int width, int height,
                      const PixelMask& mask = {}, int threads = 0);

/// Value and gradient of `photometric_loss`.
template <typename T>
struct PhotometricLoss {
  double value = 0;  ///< (1 - lambda) l1 + lambda (1 - ssim)
  double l1 = 0;     ///< Mean absolute difference.
  double ssim = 1;   ///< Mean structural similarity.
  Array<T> dL_drgb;  ///< [H,W,3] zero where a pixel is not wanted
};

/// Computes the colour loss of 3DGS (Kerbl et al. 2023, eq. 7): L1 and the structural similarity
/// SSIM (Wang et al. 2004) of each channel, with a Gaussian window of 11 x 11 pixels and sigma 1.5,
/// and C1 = 0.01^2, C2 = 0.03^2 for colours in 0 to 1.
///
/// The window counts wanted pixels only, with their weights scaled to sum 1: neither the border of
/// the image nor that of a mask enters as black pixels, and an image may be smaller than the
/// window. Where both images are constant and equal, SSIM is 1.
/// @param rgb, target  [H,W,3] rendered and measured colours
/// @param dssim_weight  lambda, in [0, 1]
/// @param exposure  Applied to `rgb` first; the gradient takes it as a constant.
/// @throws std::invalid_argument  if the mask has another size, a wanted number is not finite, or
///   dssim_weight is out of range.
template <typename T>
PhotometricLoss<T> photometric_loss(const T* rgb, const T* target, int width, int height,
                                    const PixelMask& mask = {}, double dssim_weight = 0.2,
                                    const Exposure& exposure = {}, int threads = 0);

/// Value and gradient of `depth_loss`.
template <typename T>
struct DepthLoss {
  double value = 0;       ///< Mean |rendered - measured|, m or relative.
  std::size_t count = 0;  ///< Pixels that were compared.
  Array<T> dL_ddepth;     ///< [H,W]
};

/// Computes the L1 loss of the expected depth. A pixel counts if it is wanted, was measured (target
/// >= 1e-30; less and NaN mean no measurement) and rendered (depth > 0).
/// @param depth, target  [H,W] z in the camera frame, m
/// @param relative  Whether each difference is divided by the measured depth.
/// @throws std::invalid_argument  if the mask has another size, or `depth` is not finite or
/// negative.
template <typename T>
DepthLoss<T> depth_loss(const T* depth, const T* target, int width, int height,
                        const PixelMask& mask = {}, bool relative = false, int threads = 0);

}  // namespace gslts::optim
