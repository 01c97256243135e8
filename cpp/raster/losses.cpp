#include "losses.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {
namespace {

void require_size(const char* function, int width, int height) {
  if (width > 0 && height > 0) return;
  std::ostringstream message;
  message << function << ": width and height must be positive, got " << width << " x " << height;
  throw std::invalid_argument(message.str());
}

/// Calls visit(pixel) for the index of each wanted pixel, in row-major order.
template <typename Visit>
void for_each_wanted(const WantedPixels& wanted, int width, int height, Visit visit) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (wanted.pixel(x, y)) visit(std::size_t(y) * width + x);
    }
  }
}

template <typename T>
void require_finite_images(const char* function, const T* rgb, const T* target,
                           const WantedPixels& wanted, int width, int height) {
  const auto require = [&](const char* name, const T* image) {
    for_each_wanted(wanted, width, height, [&](std::size_t pixel) {
      for (std::size_t c = 0; c < 3; ++c) {
        const T value = image[3 * pixel + c];
        if (std::isfinite(value)) continue;
        std::ostringstream message;
        message << function << ": " << name << "[" << pixel / width << "," << pixel % width << ","
                << c << "] is " << value << ", must be finite";
        throw std::invalid_argument(message.str());
      }
    });
  };
  require("rgb", rgb);
  require("target", target);
}

}  // namespace

template <typename T>
Exposure fit_exposure(const T* rgb, const T* target, int width, int height, const PixelMask& mask) {
  const char* const function = "fit_exposure";
  require_size(function, width, height);
  const WantedPixels wanted(mask, width, height, function);
  // Around the means, so that nothing cancels.
  std::size_t count = 0;
  double mean_x[3] = {}, mean_y[3] = {};
  for_each_wanted(wanted, width, height, [&](std::size_t pixel) {
    ++count;
    for (std::size_t c = 0; c < 3; ++c) {
      mean_x[c] += double(rgb[3 * pixel + c]);
      mean_y[c] += double(target[3 * pixel + c]);
    }
  });
  Exposure exposure;
  if (count == 0) return exposure;
  double variance[3] = {}, covariance[3] = {};
  for (std::size_t c = 0; c < 3; ++c) mean_x[c] /= double(count), mean_y[c] /= double(count);
  for_each_wanted(wanted, width, height, [&](std::size_t pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double x = double(rgb[3 * pixel + c]) - mean_x[c];
      variance[c] += x * x;
      covariance[c] += x * (double(target[3 * pixel + c]) - mean_y[c]);
    }
  });
  for (std::size_t c = 0; c < 3; ++c) {
    if (!std::isfinite(variance[c]) || !std::isfinite(covariance[c])) {
      require_finite_images(function, rgb, target, wanted, width, height);
    }
    // A standard deviation of 1e-6 is nothing but rounding.
    if (variance[c] > 1e-12 * double(count)) exposure.gain[c] = covariance[c] / variance[c];
    exposure.offset[c] = mean_y[c] - exposure.gain[c] * mean_x[c];
  }
  return exposure;
}

template <typename T>
PhotometricLoss<T> photometric_loss(const T* rgb, const T* target, int width, int height,
                                    const PixelMask& mask, double dssim_weight,
                                    const Exposure& exposure, int threads) {
  const char* const function = "photometric_loss";
  require_size(function, width, height);
  if (!(dssim_weight >= 0 && dssim_weight <= 1)) {
    throw std::invalid_argument(std::string(function) + ": dssim_weight must be in [0, 1], got " +
                                std::to_string(dssim_weight));
  }
  const WantedPixels wanted(mask, width, height, function);
  const std::size_t pixels = std::size_t(width) * height;
  PhotometricLoss<T> loss;
  PhotometricTask<T> task;
  task.box = wanted.all() ? Rect{0, 0, width, height} : wanted.bounds();
  const int rows = task.box.y1 - task.box.y0;
  std::size_t count = 3 * pixels;
  if (!wanted.all()) {
    loss.dL_drgb.assign(3 * pixels, T(0));
    count = 0;
    for_each_wanted(wanted, width, height, [&](std::size_t) { count += 3; });
  } else {
    loss.dL_drgb.resize(3 * pixels);
  }
  if (count == 0) return loss;

  task.rgb = rgb;
  task.target = target;
  task.width = width;
  task.wanted = &wanted;
  for (int c = 0; c < 3; ++c) {
    task.gain[c] = T(exposure.gain[c]);
    task.offset[c] = T(exposure.offset[c]);
  }
  task.l1_weight = T((1 - dssim_weight) / double(count));
  task.ssim_weight = T(dssim_weight / double(count));
  task.dL_drgb = loss.dL_drgb.data();
  std::vector<PhotometricSums> sums(rows);
  const int parts = std::min(rows, parallel::resolve_threads(threads));
  parallel::parallel_for(parts, parts, [&](std::size_t part) {
    const int first = int(std::int64_t(rows) * std::int64_t(part) / parts);
    const int last = int(std::int64_t(rows) * std::int64_t(part + 1) / parts);
    photometric_rows(task, first, last, sums.data());
  });
  PhotometricSums total;
  for (const PhotometricSums& row : sums) {
    total.l1 += row.l1;
    total.ssim += row.ssim;
  }
  loss.l1 = total.l1 / double(count);
  loss.ssim = total.ssim / double(count);
  loss.value = (1 - dssim_weight) * loss.l1 + dssim_weight * (1 - loss.ssim);
  if (!std::isfinite(loss.value)) {
    require_finite_images(function, rgb, target, wanted, width, height);
    throw std::invalid_argument(std::string(function) +
                                ": colours are too large for their squares to be finite");
  }
  return loss;
}

template <typename T>
DepthLoss<T> depth_loss(const T* depth, const T* target, int width, int height,
                        const PixelMask& mask) {
  const char* const function = "depth_loss";
  require_size(function, width, height);
  const WantedPixels wanted(mask, width, height, function);
  DepthLoss<T> loss;
  loss.dL_ddepth.assign(std::size_t(width) * height, T(0));
  double sum = 0;
  for_each_wanted(wanted, width, height, [&](std::size_t pixel) {
    if (!(depth[pixel] >= 0) || !std::isfinite(depth[pixel])) {
      std::ostringstream message;
      message << function << ": depth[" << pixel / width << "," << pixel % width << "] is "
              << depth[pixel] << ", must be finite and not negative";
      throw std::invalid_argument(message.str());
    }
    if (depth[pixel] == 0 || !(target[pixel] > 0) || !std::isfinite(target[pixel])) return;
    const T difference = depth[pixel] - target[pixel];
    ++loss.count;
    sum += std::abs(double(difference));
    loss.dL_ddepth[pixel] = T((difference > 0) - (difference < 0));
  });
  if (loss.count == 0) return loss;
  loss.value = sum / double(loss.count);
  const T weight = T(1 / double(loss.count));
  for (T& gradient : loss.dL_ddepth) gradient *= weight;
  return loss;
}

template Exposure fit_exposure(const float*, const float*, int, int, const PixelMask&);
template Exposure fit_exposure(const double*, const double*, int, int, const PixelMask&);
template PhotometricLoss<float> photometric_loss(const float*, const float*, int, int,
                                                 const PixelMask&, double, const Exposure&, int);
template PhotometricLoss<double> photometric_loss(const double*, const double*, int, int,
                                                  const PixelMask&, double, const Exposure&, int);
template DepthLoss<float> depth_loss(const float*, const float*, int, int, const PixelMask&);
template DepthLoss<double> depth_loss(const double*, const double*, int, int, const PixelMask&);

}  // namespace gslts::raster
