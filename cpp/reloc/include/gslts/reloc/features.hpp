#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::reloc {

/// Bytes of a descriptor of ORB (Rublee et al. 2011): 256 bits.
inline constexpr std::size_t kDescriptorBytes = 32;

/// Settings of feature extraction.
struct FeatureRule {
  int count = 1000;         ///< Maximum number of features, spread over the image. > 0
  double scale_step = 1.2;  ///< Ratio of the sizes of neighbouring levels of the pyramid. > 1
  int levels = 8;           ///< Number of levels of the pyramid, 1 to 16.
  int fast_threshold = 10;  ///< Minimum grey difference of a FAST corner, 1 to 254.
};

/// Keypoints with descriptors, the strongest of each part of the image.
struct Features {
  Array<float> pixels;              ///< [M,2] (u, v), pixel centres at + 0.5.
  Array<std::uint8_t> descriptors;  ///< [M,32] ORB, 256 bits.
  std::size_t size() const { return pixels.size() / 2; }
};

/// Extracts oriented FAST keypoints with rotated BRIEF descriptors (ORB, Rublee et al. 2011),
/// spread over the image as in ORB-SLAM (Mur-Artal et al. 2015), so that one poster does not take
/// them all.
/// @param grey  [H,W] intensities.
/// @param width, height  Size of the image, px.
/// @param mask  [H,W], nonzero where features are wanted; null means everywhere.
/// @throws std::invalid_argument  if a size or a setting is out of range.
Features features_of(const std::uint8_t* grey, int width, int height,
                     const std::uint8_t* mask = nullptr, const FeatureRule& rule = {});

}  // namespace gslts::reloc
