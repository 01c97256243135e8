#include "color_histogram.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace gslts::detect {
namespace {

/// Returns the bin of a value in [low, low + 1]; the first one for NaN.
int bin_of(float value, float low, int bins) {
  const float position = (value - low) * float(bins);
  return position > 0 ? int(std::min(position, float(bins - 1))) : 0;
}

/// Moves half of each count to the neighbours along an axis, whose bins are `stride` apart.
std::vector<float> smooth_along(const std::vector<float>& counts, int bins, int stride) {
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
  const int red_green = bin_of(red - green, -0.5f, kOpponentBins);
  const int yellow_blue = bin_of((red + green) / 2 - blue, -0.5f, kOpponentBins);
  const int brightness = bin_of((red + green + blue) / 3, 0, kBrightnessBins);
  const int bin = (brightness * kOpponentBins + red_green) * kOpponentBins + yellow_blue;
  counts_[std::size_t(bin)] += weight;
}

std::vector<float> ColorHistogram::shares() const {
  std::vector<float> shares = smooth_along(counts_, kOpponentBins, 1);
  shares = smooth_along(shares, kOpponentBins, kOpponentBins);
  shares = smooth_along(shares, kBrightnessBins, kOpponentBins * kOpponentBins);
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
