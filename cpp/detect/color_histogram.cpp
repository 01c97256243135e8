#include "color_histogram.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace gslts::detect {
namespace {

/// The first one for NaN.
int bin_of(float value, float low, int bins) {
  const float place = (value - low) * float(bins);
  return place > 0 ? int(std::min(place, float(bins - 1))) : 0;
}

/// Each count, half of which goes to the neighbours along an axis, `stride` apart.
std::vector<float> smoothed_along(const std::vector<float>& counts, int bins, int stride) {
  std::vector<float> result(counts.size());
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] == 0) continue;
    const int bin = int(k) / stride % bins;
    const int below = bin > 0 ? stride : 0, above = bin + 1 < bins ? stride : 0;
    result[k] += counts[k] / 2;
    result[k - std::size_t(below)] += counts[k] / 4;
    result[k + std::size_t(above)] += counts[k] / 4;
  }
  return result;
}

}  // namespace

void ColorHistogram::add(const float* rgb, float weight) {
  const float red = rgb[0], green = rgb[1], blue = rgb[2];
  const int one = bin_of(red - green, -0.5f, kOpponents);
  const int other = bin_of((red + green) / 2 - blue, -0.5f, kOpponents);
  const int brightness = bin_of((red + green + blue) / 3, 0, kBrightnesses);
  counts_[std::size_t((brightness * kOpponents + one) * kOpponents + other)] += weight;
}

std::vector<float> ColorHistogram::smoothed() const {
  std::vector<float> shares = smoothed_along(counts_, kBins[2], 1);
  shares = smoothed_along(shares, kBins[1], kOpponents);
  shares = smoothed_along(shares, kBins[0], kOpponents * kOpponents);
  const float sum = std::accumulate(shares.begin(), shares.end(), 0.0f);
  for (float& share : shares) share /= sum;
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
