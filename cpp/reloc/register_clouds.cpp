#include "gslts/reloc/register_clouds.hpp"

// PCL's templates are compiled into this file, so that no library of PCL is needed. Of its
// libraries they would call two functions of the console only: these have another name here, and
// are below.
#define PCL_NO_PRECOMPILE
#define console gslts_console
#include <pcl/filters/voxel_grid.h>
#include <pcl/registration/gicp.h>
#undef console

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "gslts/map/require.hpp"
#include "gslts/map/se3.hpp"

namespace pcl::gslts_console {

bool isVerbosityLevelEnabled(VERBOSITY_LEVEL /*level*/) { return false; }

void print(VERBOSITY_LEVEL /*level*/, const char* /*format*/, ...) {}

}  // namespace pcl::gslts_console

namespace gslts::reloc {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

/// Name in messages.
constexpr const char* kFunction = "register_clouds";

/// Changes of the translation (m) and of the entries of the rotation between two iterations, below
/// which the registration has converged: far below the noise of depth cameras.
constexpr double kConvergedTranslation_m = 1e-4, kConvergedRotation = 1e-4;

void validate(const CloudRule& rule) {
  require(rule.voxel_m >= 1e-4 && rule.voxel_m <= 10, kFunction, "voxel_m must be in 1e-4..10",
          rule.voxel_m);
  require(rule.max_distance_m > 0 && rule.max_distance_m <= 100, kFunction,
          "max_distance_m must be in (0, 100]", rule.max_distance_m);
  require(rule.neighbours >= 4, kFunction, "neighbours must be at least 4", rule.neighbours);
  require(rule.iterations >= 1, kFunction, "iterations must be positive", rule.iterations);
}

void require_rigid(const Eigen::Isometry3d& guess) {
  if (guess.matrix().allFinite() && is_rotation(guess.linear())) return;
  const Eigen::IOFormat one_line(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ", "", "",
                                 "[", "]");
  fail(kFunction, "guess must be a finite rigid motion", guess.matrix().format(one_line));
}

Eigen::Vector3d point_at(const float* points, std::size_t i) {
  return Eigen::Map<const Eigen::Vector3f>(points + 3 * i).cast<double>();
}

/// Transforms points, and keeps those that lie in `part` then.
Cloud::Ptr transform(const float* points, std::size_t count, const Eigen::Isometry3d& motion,
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

/// Downsamples a cloud to the mean of the points in each voxel.
Cloud::Ptr downsample(const Cloud::ConstPtr& cloud, double voxel_m, const char* name) {
  if (cloud->empty()) return pcl::make_shared<Cloud>();
  Eigen::AlignedBox3f box;
  for (const pcl::PointXYZ& point : *cloud) box.extend(point.getVector3fMap());
  // PCL numbers voxels with 32 bits; where that does not suffice, it leaves the cloud as it is.
  const double voxels = (box.sizes().cast<double>().array() / voxel_m + 2).prod();
  if (voxels > std::numeric_limits<std::int32_t>::max()) {
    std::ostringstream message;
    message << "register_clouds: " << name << " spans " << voxels << " voxels of " << voxel_m
            << " m, more than 2^31";
    throw std::invalid_argument(message.str());
  }
  const auto result = pcl::make_shared<Cloud>();
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setLeafSize(Eigen::Vector4f::Constant(float(voxel_m)));
  grid.setInputCloud(cloud);
  grid.filter(*result);
  return result;
}

class Gicp : public pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ, double> {
 public:
  /// PCL reports convergence also where it ran out of iterations.
  bool has_converged() const { return converged_ && nr_iterations_ < max_iterations_; }

  /// Squared distance of a point from the plane of a point of the target, m^2. The covariance of
  /// the latter is the identity but for gicp_epsilon_ along the normal of its plane.
  double squared_plane_distance(const pcl::PointXYZ& point, pcl::index_t row) const {
    const Eigen::Vector3d offset =
        (point.getVector3fMap() - (*target_)[row].getVector3fMap()).cast<double>();
    const Eigen::Matrix3d& covariance = (*target_covariances_)[std::size_t(row)];
    const double along_normal = offset.dot(offset - covariance * offset) / (1 - gicp_epsilon_);
    return std::max(along_normal, 0.0);
  }
};

/// Registers clouds from where they are; nothing if they have too few points.
std::optional<Registration> run_gicp(const Cloud::ConstPtr& source, const Cloud::ConstPtr& target,
                                     const CloudRule& rule) {
  // PCL would print, and read past the end of a cloud.
  if (std::min(source->size(), target->size()) < std::size_t(rule.neighbours)) return {};
  Gicp gicp;
  gicp.setInputSource(source);
  gicp.setInputTarget(target);
  gicp.setCorrespondenceRandomness(rule.neighbours);
  gicp.setMaxCorrespondenceDistance(rule.max_distance_m);
  gicp.setMaximumIterations(rule.iterations);
  gicp.setTransformationEpsilon(kConvergedTranslation_m);
  gicp.setRotationEpsilon(kConvergedRotation);
  Cloud aligned;
  gicp.align(aligned);
  const Eigen::Matrix4d motion = gicp.getFinalTransformation();
  if (!motion.allFinite()) return {};

  const auto tree = gicp.getSearchMethodTarget();
  pcl::Indices row(1);
  std::vector<float> squared_m2(1);
  std::size_t partners = 0;
  double sum_m2 = 0;
  for (const pcl::PointXYZ& point : aligned) {
    tree->nearestKSearch(point, 1, row, squared_m2);
    if (double(squared_m2[0]) > rule.max_distance_m * rule.max_distance_m) continue;
    ++partners;
    sum_m2 += gicp.squared_plane_distance(point, row[0]);
  }
  return Registration{Eigen::Isometry3d(motion), double(partners) / double(aligned.size()),
                      partners == 0 ? 0 : std::sqrt(sum_m2 / double(partners)),
                      gicp.has_converged()};
}

}  // namespace

Registration register_clouds(const float* source, std::size_t sources, const float* target,
                             std::size_t targets, const Eigen::Isometry3d& guess,
                             const CloudRule& rule) {
  validate(rule);
  require_rigid(guess);
  require_finite_points(kFunction, "source", source, sources);
  require_finite_points(kFunction, "target", target, targets);
  if (sources == 0) return {guess, 0, 0, false};

  // PCL computes in float: coordinates are relative to the middle of the source, after the guess.
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < sources; ++i) box.extend(guess * point_at(source, i));
  const Eigen::Isometry3d target_from_middle(Eigen::Translation3d(box.center()));
  const Eigen::Isometry3d middle_from_target = target_from_middle.inverse();
  box.translate(-box.center());
  // Upper bound of the motion of any point of the source, for rotations below 29 degrees.
  const Eigen::Vector3d reach =
      Eigen::Vector3d::Constant(rule.max_distance_m + box.diagonal().norm() / 4);
  const Eigen::AlignedBox3d around(box.min() - reach, box.max() + reach);

  const std::optional<Registration> found = run_gicp(
      downsample(transform(source, sources, middle_from_target * guess, around), rule.voxel_m,
                 "source"),
      downsample(transform(target, targets, middle_from_target, around), rule.voxel_m, "target"),
      rule);
  if (!found) return {guess, 0, 0, false};
  return {target_from_middle * found->target_from_source * middle_from_target * guess,
          found->overlap, found->rms_m, found->converged};
}

}  // namespace gslts::reloc
