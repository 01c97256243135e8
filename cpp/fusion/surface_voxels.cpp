#include "gslts/fusion/surface_voxels.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "surface_points.hpp"

namespace gslts::fusion {
namespace {

/// Bits of a coordinate in a key: 2^21 voxels of 1 cm are 20 km.
constexpr int kKeyBits = 21;
/// Voxels to each side of the corner that keys count from.
constexpr double kHalfRange = 1 << (kKeyBits - 1);
/// Voxels are counted from a corner that is a multiple of this number, so that the voxels of 2, 4,
/// ... times the edge do not depend on the position of the first camera.
constexpr double kAlignment = 1024;
/// Maximum distance of the origin from that of the world, in voxels: beyond, a double is coarser
/// than 1/4096 of the edge.
constexpr double kMaxOrigin = 1099511627776.0;  // 2^40

/// Initial size of the hash table.
constexpr std::size_t kMinSlots = 1024;

/// Fibonacci hashing: Knuth, The Art of Computer Programming 3, section 6.4. The middle bits of the
/// product depend on most of the key's.
std::size_t scattered(std::int64_t key) {
  return std::size_t(std::uint64_t(key) * 0x9e3779b97f4a7c15 >> 32);
}

/// The low 21 bits, each followed, going up, by two zeros.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x001f00000000ffff;
  bits = (bits | bits << 16) & 0x001f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  bits = (bits | bits << 2) & 0x1249249249249249;
  return bits;
}

/// A corner of the grid near a camera.
Eigen::Vector3d corner_near(const Eigen::Vector3d& eye, double edge_m) {
  const Eigen::Vector3d in_voxels = eye / edge_m;
  if (in_voxels.cwiseAbs().maxCoeff() > kMaxOrigin) {
    std::ostringstream message;
    message << "SurfaceVoxels.add: the camera is too far from the world's origin for voxels of "
            << edge_m << " m, at (" << eye.x() << ", " << eye.y() << ", " << eye.z() << ") m";
    throw std::invalid_argument(message.str());
  }
  return (in_voxels / kAlignment).array().floor() * kAlignment * edge_m;
}

/// The key of the voxel that holds a point relative to `origin`.
std::int64_t key_of(const Eigen::Vector3d& point, const Eigen::Vector3d& origin, double edge_m) {
  const Eigen::Array3d cell = (point.array() / edge_m).floor() + kHalfRange;
  // Before the cast, which is undefined for what does not fit; NaN fails the comparison too.
  if (!((cell >= 0).all() && (cell < 2 * kHalfRange).all())) {
    const Eigen::Vector3d in_world = point + origin;
    std::ostringstream message;
    message << "SurfaceVoxels.add: a point is too far from the first camera for voxels of "
            << edge_m << " m, at (" << in_world.x() << ", " << in_world.y() << ", " << in_world.z()
            << ") m";
    throw std::invalid_argument(message.str());
  }
  const auto bits = [&](int axis) { return spread(std::uint64_t(cell[axis])); };
  return std::int64_t(bits(0) << 2 | bits(1) << 1 | bits(2));
}

}  // namespace

SurfaceVoxels::SurfaceVoxels(double edge_m, int pixel_step)
    : edge_m_(edge_m), pixel_step_(pixel_step) {
  std::ostringstream message;
  if (!(edge_m > 0) || !std::isfinite(edge_m)) {
    message << "SurfaceVoxels: edge_m must be positive and finite, got " << edge_m;
    throw std::invalid_argument(message.str());
  }
  if (pixel_step < 1) {
    message << "SurfaceVoxels: pixel_step must be at least 1, got " << pixel_step;
    throw std::invalid_argument(message.str());
  }
}

void SurfaceVoxels::add(const float* depth, const std::uint8_t* rgb, const Camera& camera,
                        const std::uint8_t* mask) {
  validate(camera, "SurfaceVoxels.add");
  const Eigen::Vector3d origin =
      origin_ ? *origin_ : corner_near(camera.world_from_camera.translation(), edge_m_);
  Camera from_origin = camera;
  from_origin.world_from_camera.translation() -= origin;
  const Array<SurfacePoint> points = surface_points(depth, rgb, from_origin, mask, pixel_step_);
  // All keys first: an error for a point that is too far leaves the voxels unchanged.
  Array<std::int64_t> keys(points.size());
  std::transform(points.begin(), points.end(), keys.begin(), [&](const SurfacePoint& point) {
    return key_of(point.position, origin, edge_m_);
  });
  origin_ = origin;
  ++frames_;
  Voxel* voxel = nullptr;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Neighbours mostly share a voxel.
    if (i == 0 || keys[i] != keys[i - 1]) voxel = &voxel_at(keys[i]);
    const SurfacePoint& point = points[i];
    voxel->sums[0] += 1;
    voxel->sums.segment<3>(1) += point.position;
    voxel->sums.segment<3>(4) += point.normal;
    voxel->sums.segment<3>(7) += point.color;
    voxel->sums[10] += point.squared_detail;
    voxel->hits += voxel->last_frame != frames_;
    voxel->last_frame = frames_;
  }
}

SurfaceVoxels::Voxel& SurfaceVoxels::voxel_at(std::int64_t key) {
  if (2 * voxels_.size() >= slots_.size()) grow();
  Slot& slot = slot_of(key);
  if (slot.row < 0) {
    voxels_.push_back({key, 0, 0, Eigen::Matrix<double, kVoxelSums, 1>::Zero()});
    slot = {key, std::int64_t(voxels_.size()) - 1};
  }
  return voxels_[slot.row];
}

/// The slot with a key, or the free one where it belongs.
SurfaceVoxels::Slot& SurfaceVoxels::slot_of(std::int64_t key) {
  const std::size_t mask = slots_.size() - 1;
  std::size_t i = scattered(key) & mask;
  while (slots_[i].row >= 0 && slots_[i].key != key) i = (i + 1) & mask;
  return slots_[i];
}

void SurfaceVoxels::grow() {
  slots_ = Array<Slot>(std::max(kMinSlots, 2 * slots_.size()), Slot{0, -1});
  for (std::size_t row = 0; row < voxels_.size(); ++row) {
    slot_of(voxels_[row].key) = {voxels_[row].key, std::int64_t(row)};
  }
}

VoxelSums SurfaceVoxels::voxels() const {
  std::vector<std::pair<std::int64_t, const Voxel*>> ordered;
  ordered.reserve(voxels_.size());
  for (const Voxel& voxel : voxels_) ordered.emplace_back(voxel.key, &voxel);
  std::sort(ordered.begin(), ordered.end());  // By key: no key occurs twice.
  VoxelSums result;
  result.keys.resize(ordered.size());
  result.sums.resize(ordered.size() * kVoxelSums);
  result.hits.resize(ordered.size());
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    const Voxel& voxel = *ordered[i].second;
    result.keys[i] = ordered[i].first;
    result.hits[i] = voxel.hits;
    Eigen::Map<Eigen::Matrix<double, kVoxelSums, 1>> sums(result.sums.data() + i * kVoxelSums);
    sums = voxel.sums;
    sums.segment<3>(1) += voxel.sums[0] * *origin_;
  }
  return result;
}

}  // namespace gslts::fusion
