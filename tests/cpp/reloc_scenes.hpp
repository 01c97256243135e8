#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bitset>
#include <cstdint>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/reloc/landmark_index.hpp"

namespace gslts::reloc {

using Descriptor = std::array<std::uint8_t, kDescriptorBytes>;

inline Descriptor random_descriptor(std::mt19937& random) {
  Descriptor descriptor;
  for (std::uint8_t& byte : descriptor) byte = std::uint8_t(random());
  return descriptor;
}

/// A descriptor in which so many bits differ.
inline Descriptor flipped(Descriptor descriptor, int flips, std::mt19937& random) {
  std::vector<std::size_t> bits(8 * kDescriptorBytes);
  std::iota(bits.begin(), bits.end(), 0);
  std::shuffle(bits.begin(), bits.end(), random);
  for (int k = 0; k < flips; ++k) {
    const std::size_t bit = bits[std::size_t(k)];
    descriptor[bit / 8] = std::uint8_t(descriptor[bit / 8] ^ (1u << (bit % 8)));
  }
  return descriptor;
}

inline int bits_between(const std::uint8_t* a, const std::uint8_t* b) {
  std::size_t bits = 0;
  for (std::size_t k = 0; k < kDescriptorBytes; ++k) bits += std::bitset<8>(a[k] ^ b[k]).count();
  return int(bits);
}

/// Arrays of a `LandmarksView`.
struct Landmarks {
  std::vector<float> positions;
  std::vector<std::uint8_t> descriptors;
  std::vector<std::int32_t> keyframes;

  std::size_t size() const { return keyframes.size(); }
  LandmarksView view() const {
    return {size(), positions.data(), descriptors.data(), keyframes.data()};
  }
  void add(const Eigen::Vector3f& position, int keyframe, const Descriptor& descriptor) {
    positions.insert(positions.end(), position.begin(), position.end());
    descriptors.insert(descriptors.end(), descriptor.begin(), descriptor.end());
    keyframes.push_back(keyframe);
  }
  void add(const Eigen::Vector3f& position, int keyframe, std::mt19937& random) {
    add(position, keyframe, random_descriptor(random));
  }
  Eigen::Vector3f position(std::size_t k) const {
    return Eigen::Map<const Eigen::Vector3f>(&positions[3 * k]);
  }
  Descriptor descriptor(std::size_t k) const {
    Descriptor descriptor;
    std::copy_n(&descriptors[kDescriptorBytes * k], kDescriptorBytes, descriptor.begin());
    return descriptor;
  }
};

inline void add(Features& features, const Eigen::Vector2f& pixel, const Descriptor& descriptor) {
  features.pixels.insert(features.pixels.end(), pixel.begin(), pixel.end());
  features.descriptors.insert(features.descriptors.end(), descriptor.begin(), descriptor.end());
}

/// Returns the message of the exception that a function throws.
template <typename Function>
std::string message_of(Function function) {
  try {
    function();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace gslts::reloc
