#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"

namespace gslts::fusion {

/// Columns of the sums over the points of a voxel: their number, position (3, m), normal (3),
/// colour (3) and squared detail (1/m^2).
inline constexpr int kVoxelSums = 11;

/// V voxels, by ascending key.
struct VoxelSums {
  /// [V] Morton codes: 21 bits of each coordinate, interleaved, those of x first. The voxel of
  /// twice the edge, on the world's grid of such voxels, that holds a voxel has the key shifted
  /// right by 3; its eight parts follow each other. Keys depend on where the first camera stood.
  Array<std::int64_t> keys;
  Array<double> sums;        ///< [V, kVoxelSums]
  Array<std::int64_t> hits;  ///< [V] frames with points in the voxel.
};

/// Fuses depth images: sums of the measured surface points in voxels of the world.
///
/// Sums are taken in the order of the frames and of their pixels, in double and relative to a
/// corner near the first camera, so that no precision is lost far from the world's origin. Not
/// thread-safe.
class SurfaceVoxels {
 public:
  /// @param edge_m  Edge of the voxels, whose corners are multiples of it, m.
  /// @param pixel_step  Every n-th row and column of an image is used.
  /// @throws std::invalid_argument  if the edge is not positive and finite, or the step below 1.
  SurfaceVoxels(double edge_m, int pixel_step);

  /// Adds the points of an image, with normals, colours and details. A pixel counts if it and its
  /// four neighbours, `pixel_step` away, are measured and no step of the depth parts them.
  ///
  /// @param depth  [H,W] z, m; 0 and NaN mean no measurement.
  /// @param rgb  [H,W,3] sRGB.
  /// @param mask  [H,W] 0 where pixels are invalid; null means that all are valid.
  /// @throws std::invalid_argument  if the camera is invalid, a depth is negative or infinite, the
  ///   camera is farther from the world's origin than 2^40 voxels, or a point is about 2^20 voxels
  ///   from the first camera. Nothing has been added then.
  void add(const float* depth, const std::uint8_t* rgb, const Camera& camera,
           const std::uint8_t* mask);

  /// Returns all voxels so far, with positions in the world.
  VoxelSums voxels() const;

 private:
  struct Voxel {
    std::int64_t key;
    std::int64_t hits;
    std::int64_t last_frame;
    Eigen::Matrix<double, kVoxelSums, 1> sums;
  };
  /// Slot of a hash table with open addressing; with `std::unordered_map`, the table took more time
  /// than all other steps together.
  struct Slot {
    std::int64_t key;
    std::int64_t row;  ///< In `voxels_`; -1 marks a free slot.
  };

  Voxel& voxel_at(std::int64_t key);
  Slot& slot_of(std::int64_t key);
  void grow();

  double edge_m_;
  int pixel_step_;
  std::int64_t frames_ = 0;
  std::optional<Eigen::Vector3d> origin_;  ///< In the world; positions within are relative to it.
  Array<Voxel> voxels_;                    ///< In the order in which they were first seen.
  Array<Slot> slots_;                      ///< A power of two, at most half of them in use.
};

}  // namespace gslts::fusion
