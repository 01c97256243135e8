#include "ransac.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/calib3d.hpp>
#include <random>

#include "gslts/map/se3.hpp"

namespace gslts::reloc {
namespace {

using Sample = std::array<const Match*, 3>;
using Poses = std::vector<Eigen::Isometry3d>;

/// Minimum depth of a landmark in front of the camera, m.
constexpr double kNear_m = 0.05;
/// Probability that all samples had outliers when the search ends early.
constexpr double kFailureProbability = 1e-3;
/// Maximum number of samples drawn for each pose that is tried: samples whose distances disagree
/// with the measured depth are rejected at next to no cost.
constexpr int kDrawsPerPose = 20;

Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
  return {(pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy, 1};
}

Eigen::Vector3d unproject(const Camera& camera, const Match& match) {
  return match.depth_m * ray_of(camera, match.pixel);
}

/// Errors of a match over the thresholds of an inlier: two of the pixel and one of the depth.
Eigen::Vector3d errors_of(const Camera& camera, const Eigen::Vector3d& x_in_camera,
                          const Match& match, const RansacRule& rule) {
  const double u = camera.fx * x_in_camera.x() / x_in_camera.z() + camera.cx;
  const double v = camera.fy * x_in_camera.y() / x_in_camera.z() + camera.cy;
  const double margin_m = rule.inlier_depth * match.depth_m;
  return {(u - match.pixel.x()) / rule.inlier_px, (v - match.pixel.y()) / rule.inlier_px,
          margin_m > 0 ? (x_in_camera.z() - match.depth_m) / margin_m : 0};
}

double total_support(const Camera& camera, const Eigen::Isometry3d& camera_from_world,
                     const MatchSet& matches, const RansacRule& rule) {
  double sum = 0;
  for (const Match& match : matches) sum += support_of(camera, camera_from_world, match, rule);
  return sum;
}

MatchSet inliers_of(const Camera& camera, const Eigen::Isometry3d& camera_from_world,
                    const MatchSet& matches, const RansacRule& rule) {
  MatchSet inliers;
  for (const Match& match : matches) {
    if (support_of(camera, camera_from_world, match, rule) > 0) inliers.push_back(match);
  }
  return inliers;
}

/// Returns true if the distances between three points in the world agree with those in the camera
/// frame; false if points coincide.
bool is_congruent(const Camera& camera, const Sample& sample, const RansacRule& rule) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Match &a = *sample[k], &b = *sample[(k + 1) % 3];
    const double apart_m = (a.x_in_world - b.x_in_world).norm();
    const double seen_m = (unproject(camera, a) - unproject(camera, b)).norm();
    const double share_px = rule.inlier_px / std::min(camera.fx, camera.fy);
    const double margin_m = (rule.inlier_depth + share_px) * (a.depth_m + b.depth_m);
    if (!(apart_m > 0) || !(std::abs(apart_m - seen_m) <= margin_m)) return false;
  }
  return true;
}

/// Pose of three points with measured depth (Umeyama 1991).
Poses poses_from_depths(const Camera& camera, const Sample& sample) {
  Eigen::Matrix3d in_world, in_camera;
  for (int k = 0; k < 3; ++k) {
    in_world.col(k) = sample[std::size_t(k)]->x_in_world;
    in_camera.col(k) = unproject(camera, *sample[std::size_t(k)]);
  }
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::umeyama(in_world, in_camera, false);
  return {pose};
}

/// Up to four poses of three points without depth, by P3P (Gao et al. 2003).
Poses poses_from_rays(const Camera& camera, const Sample& sample) {
  std::array<cv::Point3d, 3> points;
  std::array<cv::Point2d, 3> pixels;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d& x = sample[k]->x_in_world;
    points[k] = {x.x(), x.y(), x.z()};
    const Eigen::Vector3d ray = ray_of(camera, sample[k]->pixel);
    pixels[k] = {ray.x(), ray.y()};
  }
  std::vector<cv::Mat> rotations, translations;
  cv::solveP3P(points, pixels, cv::Matx33d::eye(), cv::noArray(), rotations, translations,
               cv::SOLVEPNP_P3P);
  Poses poses;
  for (std::size_t k = 0; k < rotations.size(); ++k) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = rotation_from_vector(Eigen::Vector3d(rotations[k].ptr<double>()));
    pose.translation() = Eigen::Map<const Eigen::Vector3d>(translations[k].ptr<double>());
    poses.push_back(pose);
  }
  return poses;
}

/// Number of samples after which one without outliers was drawn, but for kFailureProbability.
double draws_needed(double inlier_share) {
  const double clean = std::pow(inlier_share, 3);
  return clean < 1 ? std::log(kFailureProbability) / std::log1p(-clean) : 0;
}

/// Draws three different matches. std::uniform_int_distribution differs between libraries.
Sample draw_sample(const std::vector<const Match*>& from, std::mt19937& random) {
  const std::size_t count = from.size();
  std::size_t a = random() % count, b = random() % (count - 1), c = random() % (count - 2);
  if (b >= a) ++b;
  if (c >= std::min(a, b)) ++c;
  if (c >= std::max(a, b)) ++c;
  return {from[a], from[b], from[c]};
}

/// Computes a Gauss-Newton step over the inliers, a twist (rho, phi) of the camera frame: a point x
/// moves by rho + cross(phi, x).
Vector6 gauss_newton_step(const Camera& camera, const Eigen::Isometry3d& camera_from_world,
                          const MatchSet& matches, const RansacRule& rule) {
  Matrix6 normal = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  for (const Match& match : inliers_of(camera, camera_from_world, matches, rule)) {
    const Eigen::Vector3d x = camera_from_world * match.x_in_world;
    const double margin_m = rule.inlier_depth * match.depth_m;
    Eigen::Matrix3d errors_by_x;
    errors_by_x.topRows<2>() = projection_jacobian(camera, x) / rule.inlier_px;
    errors_by_x.row(2) << 0, 0, margin_m > 0 ? 1 / margin_m : 0;
    Eigen::Matrix<double, 3, 6> errors_by_twist;
    errors_by_twist << errors_by_x, -errors_by_x * cross_matrix(x);
    normal += errors_by_twist.transpose() * errors_by_twist;
    gradient += errors_by_twist.transpose() * errors_of(camera, x, match, rule);
  }
  return normal.ldlt().solve(-gradient);
}

/// The pose of a sample of `from` with the greatest support by all matches.
std::optional<Eigen::Isometry3d> best_of_samples(const Camera& camera,
                                                 const std::vector<const Match*>& from,
                                                 bool by_depth, const MatchSet& matches,
                                                 const RansacRule& rule) {
  std::mt19937 random(1);
  std::optional<Eigen::Isometry3d> best;
  double max_support = 0, needed = double(rule.iterations) * (by_depth ? kDrawsPerPose : 1);
  for (int draw = 0, tried = 0; draw < needed && tried < rule.iterations; ++draw) {
    const Sample sample = draw_sample(from, random);
    if (by_depth && !is_congruent(camera, sample, rule)) continue;
    ++tried;
    for (const Eigen::Isometry3d& pose :
         by_depth ? poses_from_depths(camera, sample) : poses_from_rays(camera, sample)) {
      if (!pose.matrix().allFinite()) continue;
      const double support = total_support(camera, pose, matches, rule);
      if (support <= max_support) continue;
      max_support = support;
      best = pose;
      const std::size_t inliers = inliers_of(camera, pose, matches, rule).size();
      needed = std::min(needed, draws_needed(double(inliers) / double(matches.size())));
    }
  }
  return best;
}

}  // namespace

double support_of(const Camera& camera, const Eigen::Isometry3d& camera_from_world,
                  const Match& match, const RansacRule& rule) {
  const Eigen::Vector3d x_in_camera = camera_from_world * match.x_in_world;
  if (!(x_in_camera.z() > kNear_m)) return 0;
  const Eigen::Vector3d errors = errors_of(camera, x_in_camera, match, rule);
  const double off_px = errors.head<2>().squaredNorm(), off_m = errors.z() * errors.z();
  return off_px < 1 && off_m < 1 ? 1 - 0.5 * (off_px + off_m) : 0;
}

Eigen::Isometry3d refine_inliers(const Camera& camera, Eigen::Isometry3d camera_from_world,
                                 const MatchSet& matches, const RansacRule& rule) {
  constexpr int kSteps = 8;
  double support = total_support(camera, camera_from_world, matches, rule);
  for (int step = 0; step < kSteps; ++step) {
    const Vector6 twist = gauss_newton_step(camera, camera_from_world, matches, rule);
    if (!twist.allFinite()) break;
    Eigen::Isometry3d moved = camera_from_world;
    moved.prerotate(rotation_from_vector(twist.tail<3>()));
    moved.pretranslate(twist.head<3>());
    const double moved_support = total_support(camera, moved, matches, rule);
    if (!(moved_support > support)) break;
    support = moved_support;
    camera_from_world = moved;
  }
  return camera_from_world;
}

std::optional<Eigen::Isometry3d> ransac(const Camera& camera, const MatchSet& matches,
                                        const RansacRule& rule) {
  std::vector<const Match*> from, with_depth;
  for (const Match& match : matches) {
    from.push_back(&match);
    if (match.depth_m > 0) with_depth.push_back(&match);
  }
  const bool by_depth =
      with_depth.size() >= std::size_t(rule.min_inliers) && 4 * with_depth.size() >= matches.size();
  if (by_depth) from = std::move(with_depth);
  if (from.size() < std::size_t(rule.min_inliers)) return std::nullopt;
  std::optional<Eigen::Isometry3d> best = best_of_samples(camera, from, by_depth, matches, rule);
  if (!best) return std::nullopt;
  best = refine_inliers(camera, *best, matches, rule);
  const MatchSet inliers = inliers_of(camera, *best, matches, rule);
  return inliers.size() < std::size_t(rule.min_inliers) ? std::nullopt : best;
}

}  // namespace gslts::reloc
