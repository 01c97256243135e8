#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/reloc/features.hpp"

namespace gslts::reloc {

/// Read-only, non-owning view of L landmarks: 3D positions of keypoints with descriptors, seen in K
/// keyframes of a map.
struct LandmarksView {
  std::size_t size = 0;                       ///< L
  const float* positions = nullptr;           ///< [L,3] from the map's origin, m
  const std::uint8_t* descriptors = nullptr;  ///< [L,32]
  const std::int32_t* keyframes = nullptr;    ///< [L] index of the keyframe that saw it, 0 to K - 1
};

/// The nearest landmarks of each of M features, by Hamming distance, the nearest first.
struct Matches {
  int k = 0;
  Array<std::int32_t> landmarks;  ///< [M,k]; -1 where there are fewer.
  Array<std::int32_t> distances;  ///< [M,k] in bits, 0 to 256; 256 where there are fewer.
};

/// Finds landmarks by their descriptors, approximately, by FLANN's multi-probe locality-sensitive
/// hashing (Lv et al. 2007). Keeps a copy of the landmarks. The same landmarks give the same index,
/// whatever else uses random numbers. Threads may share it: `match` only reads.
class LandmarkIndex {
 public:
  /// @throws std::invalid_argument  if a position is not finite, or a keyframe negative.
  explicit LandmarkIndex(const LandmarksView& landmarks);
  ~LandmarkIndex();
  LandmarkIndex(LandmarkIndex&&) noexcept;
  LandmarkIndex& operator=(LandmarkIndex&&) noexcept;

  LandmarksView landmarks() const;

  /// Finds the nearest landmarks of each feature.
  /// @param k  Number of landmarks per feature, 1 to 16.
  /// @throws std::invalid_argument  if k is out of range, or a feature has no descriptor.
  Matches match(const Features& features, int k) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

}  // namespace gslts::reloc
