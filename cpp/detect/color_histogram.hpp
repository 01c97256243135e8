#pragma once

#include <cstddef>
#include <vector>

#include "constants.hpp"

namespace gslts::detect {

/// Number of bins of a histogram.
constexpr std::size_t kHistogramBins = std::size_t(kBrightnessBins) * kOpponentBins * kOpponentBins;

/// Counts colours by their opponent axes (red against green, both against blue) and by brightness.
class ColorHistogram {
 public:
  /// @param rgb     [3] sRGB, 0 to 1.
  /// @param weight  Positive.
  void add(const float* rgb, float weight);

  /// Returns the shares, spread over neighbouring bins, which sum up to 1. At least one colour must
  /// have been counted.
  std::vector<float> shares() const;

 private:
  std::vector<float> counts_ = std::vector<float>(kHistogramBins, 0.0f);
};

/// Computes the Hellinger distance of two histograms, 0 to 1; 1 if one is empty.
double distance(const std::vector<float>& a, const std::vector<float>& b);

}  // namespace gslts::detect
