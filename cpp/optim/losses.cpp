#include "gslts/optim/losses.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "gslts/parallel/parallel_for.hpp"
#include "gslts/simd/target.hpp"
#include "photometric.hpp"

namespace gslts::optim {
namespace {

void require_size(const char* function, int width, int height) {
  if (width > 0 && height > 0) return;
  std::ostringstream message;
  message << function << ": width and height must be positive, got " << width << " x " << height;
  throw std::invalid_argument(message.str());
}

/// Rows of one task; fixed, so that sums over rows do not depend on the number of threads.
constexpr int kRowsPerTask = 16;

/// Calls visit(pixel) for the index of each wanted pixel of the rows [first, last).
template <typename Visit>
void for_each_wanted(const PixelMask& wanted, int width, int first, int last, Visit visit) {
  for (int y = first; y < last; ++y) {
    for (int x = 0; x < width; ++x) {
      if (wanted.pixel(x, y)) visit(std::size_t(y) * width + x);
    }
  }
}

/// Adds up, in order, the sums that add(sum, first, last) makes of the rows [first, last).
template <typename Sum, typename Add>
Sum sum_over_rows(int height, int threads, Add add) {
  std::vector<Sum> parts(std::size_t(height + kRowsPerTask - 1) / kRowsPerTask);
  parallel::parallel_for(parts.size(), parallel::resolve_threads(threads), [&](std::size_t part) {
    const int first = int(part) * kRowsPerTask;
    Sum sum;  // Not in `parts` at once: threads would fight for its cache lines.
    add(sum, first, std::min(height, first + kRowsPerTask));
    parts[part] = sum;
  });
  Sum total;
  for (const Sum& part : parts) total += part;
  return total;
}

/// Sums of a colour over pixels.
struct ColorSums {
  std::size_t count = 0;
  double first[3] = {}, second[3] = {};

  void operator+=(const ColorSums& other) {
    count += other.count;
    for (int c = 0; c < 3; ++c) first[c] += other.first[c], second[c] += other.second[c];
  }
};

template <typename T>
void require_finite_images(const char* function, const T* rgb, const T* target,
                           const PixelMask& wanted, int width, int height) {
  const auto require = [&](const char* name, const T* image) {
    for_each_wanted(wanted, width, 0, height, [&](std::size_t pixel) {
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

/// Number of wanted pixels, and means of the colours of two images.
template <typename T>
ColorSums color_means(const T* rgb, const T* target, int width, int height, const PixelMask& mask,
                      int threads) {
  ColorSums means =
      sum_over_rows<ColorSums>(height, threads, [&](ColorSums& sum, int first, int last) {
        for_each_wanted(mask, width, first, last, [&](std::size_t pixel) {
          ++sum.count;
          for (std::size_t c = 0; c < 3; ++c) {
            sum.first[c] += double(rgb[3 * pixel + c]);
            sum.second[c] += double(target[3 * pixel + c]);
          }
        });
      });
  if (means.count == 0) return means;
  const double count = double(means.count);
  for (std::size_t c = 0; c < 3; ++c) means.first[c] /= count, means.second[c] /= count;
  return means;
}

/// Squares of the colours of `rgb` and their products with those of `target`, about the means.
template <typename T>
ColorSums color_moments(const T* rgb, const T* target, int width, int height, const PixelMask& mask,
                        const ColorSums& means, int threads) {
  return sum_over_rows<ColorSums>(height, threads, [&](ColorSums& sum, int first, int last) {
    for_each_wanted(mask, width, first, last, [&](std::size_t pixel) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double x = double(rgb[3 * pixel + c]) - means.first[c];
        sum.first[c] += x * x;
        sum.second[c] += x * (double(target[3 * pixel + c]) - means.second[c]);
      }
    });
  });
}

/// Writes the gradient of the task, and returns the sums of its rows, added up in order.
template <typename T>
PhotometricSums run_photometric(const PhotometricTask<T>& task, int threads) {
  simd::apply_environment();
  const int rows = task.box.y1 - task.box.y0;
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
  return total;
}

}  // namespace

template <typename T>
Exposure fit_exposure(const T* rgb, const T* target, int width, int height, const PixelMask& mask,
                      int threads) {
  const char* const function = "fit_exposure";
  require_size(function, width, height);
  validate(mask, width, height, function);
  const ColorSums means = color_means(rgb, target, width, height, mask, threads);
  Exposure exposure;
  if (means.count == 0) return exposure;
  const double count = double(means.count);
  // Moments about the means do not cancel.
  const ColorSums squares = color_moments(rgb, target, width, height, mask, means, threads);
  const double *variance = squares.first, *covariance = squares.second;
  for (std::size_t c = 0; c < 3; ++c) {
    if (!std::isfinite(variance[c]) || !std::isfinite(covariance[c])) {
      require_finite_images(function, rgb, target, mask, width, height);
    }
    // A standard deviation of 1e-6 is rounding error.
    if (variance[c] > 1e-12 * count) exposure.gain[c] = covariance[c] / variance[c];
    exposure.offset[c] = means.second[c] - exposure.gain[c] * means.first[c];
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
  validate(mask, width, height, function);
  const std::size_t pixels = std::size_t(width) * height;
  PhotometricLoss<T> loss;
  PhotometricTask<T> task;
  task.box = bounds_of(mask, width, height);
  std::size_t count = 3 * pixels;
  if (!mask.all()) {
    loss.dL_drgb.assign(3 * pixels, T(0));
    count = 0;
    for_each_wanted(mask, width, 0, height, [&](std::size_t) { count += 3; });
  } else {
    loss.dL_drgb.resize(3 * pixels);
  }
  if (count == 0) return loss;

  task.rgb = rgb;
  task.target = target;
  task.width = width;
  task.wanted = mask;
  for (int c = 0; c < 3; ++c) {
    task.gain[c] = T(exposure.gain[c]);
    task.offset[c] = T(exposure.offset[c]);
  }
  task.l1_weight = T((1 - dssim_weight) / double(count));
  task.ssim_weight = T(dssim_weight / double(count));
  task.dL_drgb = loss.dL_drgb.data();
  const PhotometricSums total = run_photometric(task, threads);
  loss.l1 = total.l1 / double(count);
  loss.ssim = total.ssim / double(count);
  loss.value = (1 - dssim_weight) * loss.l1 + dssim_weight * (1 - loss.ssim);
  if (!std::isfinite(loss.value)) {
    require_finite_images(function, rgb, target, mask, width, height);
    throw std::invalid_argument(std::string(function) +
                                ": colours are too large for their squares to be finite");
  }
  return loss;
}

/// Throws std::invalid_argument that names the first wanted pixel whose depth is negative or not
/// finite.
template <typename T>
void reject_depth(const char* function, const T* depth, int width, int height,
                  const PixelMask& mask) {
  for_each_wanted(mask, width, 0, height, [&](std::size_t pixel) {
    if (depth[pixel] >= 0 && std::isfinite(depth[pixel])) return;
    std::ostringstream message;
    message << function << ": depth[" << pixel / width << "," << pixel % width << "] is "
            << depth[pixel] << ", must be finite and not negative";
    throw std::invalid_argument(message.str());
  });
}

/// Minimum depth that counts as measured: relative differences of rendered depths up to 1e8 m stay
/// finite in float. It is far below any depth in metres.
constexpr double kMinMeasured = 1e-30;

template <typename T>
DepthLoss<T> depth_loss(const T* depth, const T* target, int width, int height,
                        const PixelMask& mask, bool relative, int threads) {
  const char* const function = "depth_loss";
  require_size(function, width, height);
  validate(mask, width, height, function);
  struct Sum {
    double absolute = 0;
    std::size_t count = 0, bad = 0;

    void operator+=(const Sum& other) {
      absolute += other.absolute;
      count += other.count;
      bad += other.bad;
    }
  };
  const PixelBox box = bounds_of(mask, width, height);
  DepthLoss<T> loss;
  loss.dL_ddepth.assign(std::size_t(width) * height, T(0));
  T* gradient = loss.dL_ddepth.data();
  const T greatest = std::numeric_limits<T>::max();
  const int rows = box.y1 - box.y0;
  const Sum sum = sum_over_rows<Sum>(rows, threads, [&](Sum& part, int first, int last) {
    for (int y = box.y0 + first; y < box.y0 + last; ++y) {
      double absolute = 0;
      int count = 0, bad = 0;
      // Without branches, so that the compiler makes vectors of it.
      for (int x = box.x0; x < box.x1; ++x) {
        const std::size_t pixel = std::size_t(y) * width + x;
        const T rendered = depth[pixel], measured = target[pixel];
        const int is_wanted = mask.pixel(x, y);
        const int counts =
            is_wanted & (rendered > 0) & (measured >= T(kMinMeasured)) & (measured <= greatest);
        const T difference = counts ? rendered - measured : T(0);
        const T scale = relative && counts ? 1 / measured : T(1);
        absolute += double(std::abs(difference) * scale);
        count += counts;
        bad += is_wanted & !((rendered >= 0) & (rendered <= greatest));
        gradient[pixel] = scale * T((difference > 0) - (difference < 0));
      }
      part += {absolute, std::size_t(count), std::size_t(bad)};
    }
  });
  if (sum.bad > 0) reject_depth(function, depth, width, height, mask);
  loss.count = sum.count;
  if (loss.count == 0) return loss;
  loss.value = sum.absolute / double(loss.count);
  const T weight = T(1 / double(loss.count));
  for (int y = box.y0; y < box.y1; ++y) {
    T* row = gradient + std::size_t(y) * width;
    for (int x = box.x0; x < box.x1; ++x) row[x] *= weight;
  }
  return loss;
}

template Exposure fit_exposure(const float*, const float*, int, int, const PixelMask&, int);
template Exposure fit_exposure(const double*, const double*, int, int, const PixelMask&, int);
template PhotometricLoss<float> photometric_loss(const float*, const float*, int, int,
                                                 const PixelMask&, double, const Exposure&, int);
template PhotometricLoss<double> photometric_loss(const double*, const double*, int, int,
                                                  const PixelMask&, double, const Exposure&, int);
template DepthLoss<float> depth_loss(const float*, const float*, int, int, const PixelMask&, bool,
                                     int);
template DepthLoss<double> depth_loss(const double*, const double*, int, int, const PixelMask&,
                                      bool, int);

}  // namespace gslts::optim
