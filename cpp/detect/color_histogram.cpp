#include "color_histogram.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace gslts::detect {
namespace {

int bin_of(float value, float low, int bins) {
  return std::clamp(int((value - low) * float(bins)), 0, bins - 1);
}

/// Along one axis of an image of `counts`, whose neighbours are `stride` apart.
std::vector<float> smoothed_along(const std::vector<float>& counts, int bins, int stride,
                                  const std::vector<float>& kernel) {
  std::vector<float> result(counts.size());
  const int reach = int(kernel.size()) / 2;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] == 0) continue;
    const int bin = int(k) / stride % bins;
    for (int step = -reach; step <= reach; ++step) {
      const int to = std::clamp(bin + step, 0, bins - 1);
      result[std::size_t(int(k) + (to - bin) * stride)] +=
          counts[k] * kernel[std::size_t(step + reach)];
    }
  }
  return result;
}

}  // namespace

void ColorHistogram::add(const float* rgb) {
  const float red = rgb[0], green = rgb[1], blue = rgb[2];
  const int one = bin_of(red - green, -0.5f, kOpponents);
  const int other = bin_of((red + green) / 2 - blue, -0.5f, kOpponents);
  const int brightness = bin_of((red + green + blue) / 3, 0, kBrightnesses);
  counts_[std::size_t((brightness * kOpponents + one) * kOpponents + other)] += 1;
}

std::vector<float> ColorHistogram::smoothed() const {
  const std::vector<float> wide{1 / 16.0f, 4 / 16.0f, 6 / 16.0f, 4 / 16.0f, 1 / 16.0f};
  const std::vector<float> narrow{1 / 4.0f, 2 / 4.0f, 1 / 4.0f};
  std::vector<float> shares = smoothed_along(counts_, kBins[2], 1, wide);
  shares = smoothed_along(shares, kBins[1], kOpponents, wide);
  shares = smoothed_along(shares, kBins[0], kOpponents * kOpponents, narrow);
  const float sum = std::accumulate(shares.begin(), shares.end(), 0.0f);
  for (float& share : shares) share /= std::max(sum, 1.0f);
  return shares;
}

double distance(const std::vector<float>& a, const std::vector<float>& b) {
  double overlap = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) {
    overlap += std::sqrt(double(a[k]) * double(b[k]));
  }
  return std::sqrt(std::max(0.0, 1 - overlap));
}

}  // namespace gslts::detect
