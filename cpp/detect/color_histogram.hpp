#pragma once

#include <array>
#include <vector>

namespace gslts::detect {

/// Counts colours by their opponents (red against green, both against blue) and, coarsely, as light
/// and shade change it, by brightness.
class ColorHistogram {
 public:
  /// @param rgb     [3] sRGB, 0 to 1.
  /// @param weight  Positive.
  void add(const float* rgb, float weight);

  /// Shares, spread over neighbouring bins, which sum up to 1; something must have been counted.
  std::vector<float> smoothed() const;

 private:
  static constexpr int kOpponents = 24, kBrightnesses = 4;
  static constexpr std::array<int, 3> kBins{kBrightnesses, kOpponents, kOpponents};

  std::vector<float> counts_ = std::vector<float>(kBrightnesses * kOpponents * kOpponents, 0.0f);
};

/// 0 to 1: the Hellinger distance of two such histograms.
double distance(const std::vector<float>& a, const std::vector<float>& b);

}  // namespace gslts::detect
