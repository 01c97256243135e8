#include "gslts/reloc/register_clouds.hpp"

#include <pcl/filters/voxel_grid.h>
#include <pcl/registration/gicp.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace gslts::reloc {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

/// Changes between two iterations, of the shift and of the entries of the rotation, below which the
/// clouds are at rest: far below the noise of depth cameras.
constexpr double kRestTranslationM = 1e-4, kRestRotation = 1e-4;

/// Allowed error of R^T R, as for cameras.
constexpr double kRotationTolerance = 1e-6;

template <typename Value>
[[noreturn]] void fail(const char* what, const Value& value) {
  std::ostringstream message;
  message << "register_clouds: " << what << ", got " << value;
  throw std::invalid_argument(message.str());
}

void validate(const CloudRule& rule) {
  if (!(rule.voxel_m >= 1e-4 && rule.voxel_m <= 10)) {
    fail("voxel_m must be in 1e-4..10", rule.voxel_m);
  }
  if (!(rule.most_distant_m > 0 && rule.most_distant_m <= 100)) {
    fail("most_distant_m must be in (0, 100]", rule.most_distant_m);
  }
  if (rule.neighbours < 4) fail("neighbours must be at least 4", rule.neighbours);
  if (rule.iterations < 1) fail("iterations must be positive", rule.iterations);
}

void require_rigid(const Eigen::Isometry3d& guess) {
  const Eigen::Matrix3d rotation = guess.linear();
  const Eigen::Matrix3d error = rotation.transpose() * rotation - Eigen::Matrix3d::Identity();
  if (!guess.matrix().allFinite() || error.cwiseAbs().maxCoeff() > kRotationTolerance ||
      rotation.determinant() < 0) {
    const Eigen::IOFormat one_line(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ", "", "",
                                   "[", "]");
    fail("guess must be a finite rigid motion", guess.matrix().format(one_line));
  }
}

void require_finite_rows(const float* rows, std::size_t count, const char* name) {
  const float* end = rows + 3 * count;
  const float* bad = std::find_if(rows, end, [](float x) { return !std::isfinite(x); });
  if (bad == end) return;
  throw std::invalid_argument("register_clouds: " + std::string(name) + "[" +
                              std::to_string((bad - rows) / 3) + "] is not finite");
}

Eigen::Vector3d point_at(const float* points, std::size_t i) {
  return Eigen::Map<const Eigen::Vector3f>(points + 3 * i).cast<double>();
}

/// What of the points lies in `part` after the motion.
Cloud::Ptr moved(const float* points, std::size_t count, const Eigen::Isometry3d& motion,
                 const Eigen::AlignedBox3d& part) {
  const auto cloud = pcl::make_shared<Cloud>();
  cloud->reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d point = motion * point_at(points, i);
    if (!part.contains(point)) continue;
    cloud->emplace_back(float(point.x()), float(point.y()), float(point.z()));
  }
  return cloud;
}

/// One point in each voxel: the mean of those there.
Cloud::Ptr thinned(const Cloud::ConstPtr& cloud, double voxel_m, const char* name) {
  if (cloud->empty()) return pcl::make_shared<Cloud>();
  Eigen::AlignedBox3f box;
  for (const pcl::PointXYZ& point : *cloud) box.extend(point.getVector3fMap());
  // PCL numbers the voxels in 32 bits; where that does not suffice, it would thin nothing.
  const double voxels = (box.sizes().cast<double>().array() / voxel_m + 2).prod();
  if (voxels > std::numeric_limits<std::int32_t>::max()) {
    std::ostringstream message;
    message << "register_clouds: " << name << " spans " << voxels << " voxels of " << voxel_m
            << " m, more than 2^31";
    throw std::invalid_argument(message.str());
  }
  const auto thin = pcl::make_shared<Cloud>();
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setLeafSize(Eigen::Vector4f::Constant(float(voxel_m)));
  grid.setInputCloud(cloud);
  grid.filter(*thin);
  return thin;
}

class Gicp : public pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ, double> {
 public:
  /// PCL says that it converged also where it ran out of iterations.
  bool at_rest() const { return converged_ && nr_iterations_ < max_iterations_; }

  /// How far a place is from the plane of a point of the target, squared: the covariance of that
  /// point is the identity, but for gicp_epsilon_ along the normal of its plane.
  double squared_off_plane_m2(const pcl::PointXYZ& place, pcl::index_t row) const {
    const Eigen::Vector3d offset =
        (place.getVector3fMap() - (*target_)[row].getVector3fMap()).cast<double>();
    const Eigen::Matrix3d& covariance = (*target_covariances_)[std::size_t(row)];
    const double along_normal = offset.dot(offset - covariance * offset) / (1 - gicp_epsilon_);
    return std::max(along_normal, 0.0);
  }
};

/// From where the clouds are; nothing if they have too few points.
std::optional<Registration> brought_together(const Cloud::ConstPtr& source,
                                             const Cloud::ConstPtr& target, const CloudRule& rule) {
  // PCL would print, and read past the end of a cloud.
  if (std::min(source->size(), target->size()) < std::size_t(rule.neighbours)) return {};
  Gicp gicp;
  gicp.setInputSource(source);
  gicp.setInputTarget(target);
  gicp.setCorrespondenceRandomness(rule.neighbours);
  gicp.setMaxCorrespondenceDistance(rule.most_distant_m);
  gicp.setMaximumIterations(rule.iterations);
  gicp.setTransformationEpsilon(kRestTranslationM);
  gicp.setRotationEpsilon(kRestRotation);
  Cloud there;
  gicp.align(there);
  const Eigen::Matrix4d motion = gicp.getFinalTransformation();
  if (!motion.allFinite()) return {};

  const auto tree = gicp.getSearchMethodTarget();
  pcl::Indices row(1);
  std::vector<float> squared_m2(1);
  std::size_t partners = 0;
  double sum_m2 = 0;
  for (const pcl::PointXYZ& place : there) {
    tree->nearestKSearch(place, 1, row, squared_m2);
    if (double(squared_m2[0]) > rule.most_distant_m * rule.most_distant_m) continue;
    ++partners;
    sum_m2 += gicp.squared_off_plane_m2(place, row[0]);
  }
  return Registration{Eigen::Isometry3d(motion), double(partners) / double(there.size()),
                      partners == 0 ? 0 : std::sqrt(sum_m2 / double(partners)), gicp.at_rest()};
}

}  // namespace

Registration register_clouds(const float* source, std::size_t sources, const float* target,
                             std::size_t targets, const Eigen::Isometry3d& guess,
                             const CloudRule& rule) {
  validate(rule);
  require_rigid(guess);
  require_finite_rows(source, sources, "source");
  require_finite_rows(target, targets, "target");
  if (sources == 0) return {guess, 0, 0, false};

  // PCL computes with floats: in the middle of the source, where the guess puts it, they are exact.
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < sources; ++i) box.extend(guess * point_at(source, i));
  const Eigen::Isometry3d target_from_middle(Eigen::Translation3d(box.center()));
  const Eigen::Isometry3d middle_from_target = target_from_middle.inverse();
  box.translate(-box.center());
  // No part of the source moves farther than that, if it turns by less than 29 degrees.
  const Eigen::Vector3d reach =
      Eigen::Vector3d::Constant(rule.most_distant_m + box.diagonal().norm() / 4);
  const Eigen::AlignedBox3d around(box.min() - reach, box.max() + reach);

  const std::optional<Registration> found = brought_together(
      thinned(moved(source, sources, middle_from_target * guess, around), rule.voxel_m, "source"),
      thinned(moved(target, targets, middle_from_target, around), rule.voxel_m, "target"), rule);
  if (!found) return {guess, 0, 0, false};
  return {target_from_middle * found->target_from_source * middle_from_target * guess,
          found->overlap, found->rms_m, found->converged};
}

}  // namespace gslts::reloc
