#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/chunk_bounds.hpp"

namespace gslts {

/// Read-only, non-owning view of N Gaussians stored as row-major arrays; what the kernels take.
///
/// Stored values are unconstrained, as 3DGS optimises them: scale = exp(log_scale), opacity =
/// sigmoid(logit_opacity), rotation = quat / |quat|. A quaternion shorter than 1e-12 stands for no
/// rotation.
template <typename T>
struct GaussianView {
  std::size_t size = 0;                ///< N
  int sh_bases = 1;                    ///< K = (degree + 1)^2: 1, 4, 9 or 16
  int feature_dims = 0;                ///< D
  const T* means = nullptr;            ///< [N,3] centres, m, relative to `origin`, world axes
  const T* quats = nullptr;            ///< [N,4] wxyz, map from Gaussian
  const T* log_scales = nullptr;       ///< [N,3] log of the standard deviations in m
  const T* logit_opacities = nullptr;  ///< [N]
  const T* sh = nullptr;               ///< [N,K,3] spherical harmonics, colour = 0.5 + SH, >= 0
  const T* features = nullptr;         ///< [N,D], or null when D is 0
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< Map origin in the world, m
  /// Bounds of these Gaussians, or null. With bounds, which exist only of finite numbers, a
  /// renderer reads only the chunks that may be in view, and does not check the numbers again.
  const ChunkBounds* bounds = nullptr;
};

/// A set of 3D Gaussians with identities that survive editing.
///
/// `means` are relative to `origin`, which is kept in double: a map 1,000 km from the world's
/// origin keeps its full float resolution.
template <typename T>
struct BasicGaussianMap {
  int sh_bases = 1;
  int feature_dims = 0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Array<T> means, quats, log_scales, logit_opacities, sh, features;  ///< Shapes: `GaussianView`.
  Array<std::uint64_t> ids;  ///< [N] unique, never used again once removed

  std::size_t size() const { return logit_opacities.size(); }
  /// Returns a view of the arrays.
  /// @throws std::invalid_argument  if the length of an array does not match its shape.
  GaussianView<T> view() const;
};
using GaussianMap = BasicGaussianMap<float>;

/// Makes N uninitialised Gaussians with ids first_id, first_id + 1, ...
/// @throws std::invalid_argument  if sh_bases is not 1, 4, 9 or 16, or feature_dims is negative.
template <typename T>
BasicGaussianMap<T> make_gaussian_map(std::size_t size, int sh_bases, int feature_dims = 0,
                                      std::uint64_t first_id = 0);

/// Selects Gaussians, with their ids, in the order of `rows`.
/// @throws std::invalid_argument  if there is no such row, or the arrays do not fit each other.
template <typename T>
BasicGaussianMap<T> select(const BasicGaussianMap<T>& map, const std::vector<std::uint32_t>& rows);

/// Checks shapes, pointers and the size of the bounds, not values (the kernels check the values
/// that they read).
/// @throws std::invalid_argument  naming the caller, the field and the value.
template <typename T>
void validate(const GaussianView<T>& gaussians, const char* function);

/// Checks that every number of every array is finite.
/// @throws std::invalid_argument  naming the caller, the first bad array, in the order of the
///   fields of `GaussianView`, and the index of its first bad element.
template <typename T>
void require_finite(const GaussianView<T>& gaussians, const char* function);

}  // namespace gslts
