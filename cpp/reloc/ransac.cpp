#include "ransac.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/calib3d.hpp>
#include <random>

namespace gslts::reloc {
namespace {

using Sample = std::array<const Match*, 3>;
using Poses = std::vector<Eigen::Isometry3d>;

/// Nearer to the camera than this, nothing is seen, m.
constexpr double kNear_m = 0.05;
/// Chance that no sample was free of outliers when the search ends early.
constexpr double kMissed = 1e-3;
/// Samples drawn for each pose that is tried: those whose distances do not agree cost next to
/// nothing.
constexpr int kDraws = 20;

Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
  return {(pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy, 1};
}

Eigen::Vector3d measured(const Camera& camera, const Match& match) {
  return match.depth_m * ray_of(camera, match.pixel);
}

/// Errors of a match in units of what is still an inlier: two of its pixel, and of its depth.
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

/// Whether three points are as far apart in the world as they were measured from the camera; points
/// on one place tell nothing.
bool congruent(const Camera& camera, const Sample& sample, const RansacRule& rule) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Match &a = *sample[k], &b = *sample[(k + 1) % 3];
    const double apart_m = (a.x_in_world - b.x_in_world).norm();
    const double seen_m = (measured(camera, a) - measured(camera, b)).norm();
    const double share_px = rule.inlier_px / std::min(camera.fx, camera.fy);
    const double margin_m = (rule.inlier_depth + share_px) * (a.depth_m + b.depth_m);
    if (!(apart_m > 0) || !(std::abs(apart_m - seen_m) <= margin_m)) return false;
  }
  return true;
}

/// Source: Umeyama 1991.
Poses poses_of_depths(const Camera& camera, const Sample& sample) {
  Eigen::Matrix3d in_world, in_camera;
  for (int k = 0; k < 3; ++k) {
    in_world.col(k) = sample[std::size_t(k)]->x_in_world;
    in_camera.col(k) = measured(camera, *sample[std::size_t(k)]);
  }
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::umeyama(in_world, in_camera, false);
  return {pose};
}

/// Source: Gao et al. 2003.
Poses poses_of_rays(const Camera& camera, const Sample& sample) {
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
    const Eigen::Map<const Eigen::Vector3d> rotation(rotations[k].ptr<double>());
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const double angle_rad = rotation.norm();
    if (angle_rad > 0) pose.rotate(Eigen::AngleAxisd(angle_rad, rotation / angle_rad));
    pose.translation() = Eigen::Map<const Eigen::Vector3d>(translations[k].ptr<double>());
    poses.push_back(pose);
  }
  return poses;
}

/// Samples that are needed to meet one without outliers.
double draws_needed(double inlier_share) {
  const double clean = std::pow(inlier_share, 3);
  return clean < 1 ? std::log(kMissed) / std::log1p(-clean) : 0;
}

/// The standard library leaves open what its distributions draw.
Sample drawn(const std::vector<const Match*>& from, std::mt19937& random) {
  const std::size_t count = from.size();
  std::size_t a = random() % count, b = random() % (count - 1), c = random() % (count - 2);
  if (b >= a) ++b;
  if (c >= std::min(a, b)) ++c;
  if (c >= std::max(a, b)) ++c;
  return {from[a], from[b], from[c]};
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

Eigen::Isometry3d refined(const Camera& camera, Eigen::Isometry3d camera_from_world,
                          const MatchSet& matches, const RansacRule& rule) {
  constexpr int kSteps = 8;
  double support = total_support(camera, camera_from_world, matches, rule);
  for (int step = 0; step < kSteps; ++step) {
    // Gauss-Newton: x moves by shift + turn x x.
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Match& match : inliers_of(camera, camera_from_world, matches, rule)) {
      const Eigen::Vector3d x = camera_from_world * match.x_in_world;
      const double margin_m = rule.inlier_depth * match.depth_m, z2 = x.z() * x.z();
      Eigen::Matrix3d of_x;  // Derivative of the errors.
      of_x << camera.fx / x.z() / rule.inlier_px, 0, -camera.fx * x.x() / z2 / rule.inlier_px,  //
          0, camera.fy / x.z() / rule.inlier_px, -camera.fy * x.y() / z2 / rule.inlier_px,      //
          0, 0, margin_m > 0 ? 1 / margin_m : 0;
      Eigen::Matrix3d cross;
      cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
      Eigen::Matrix<double, 3, 6> of_pose;
      of_pose << of_x, -of_x * cross;
      normal += of_pose.transpose() * of_pose;
      gradient += of_pose.transpose() * errors_of(camera, x, match, rule);
    }
    const Eigen::Matrix<double, 6, 1> move = normal.ldlt().solve(-gradient);
    if (!move.allFinite()) break;
    Eigen::Isometry3d moved = camera_from_world;
    const double angle_rad = move.tail<3>().norm();
    if (angle_rad > 0) {
      moved.prerotate(Eigen::AngleAxisd(angle_rad, move.tail<3>() / angle_rad));
    }
    moved.pretranslate(move.head<3>());
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
  const bool by_depth = with_depth.size() >= std::size_t(rule.least_inliers) &&
                        4 * with_depth.size() >= matches.size();
  if (by_depth) from = std::move(with_depth);
  if (from.size() < std::size_t(rule.least_inliers)) return std::nullopt;

  std::mt19937 random(1);
  std::optional<Eigen::Isometry3d> best;
  double most = 0, needed = double(rule.iterations) * (by_depth ? kDraws : 1);
  for (int draw = 0, tried = 0; draw < needed && tried < rule.iterations; ++draw) {
    const Sample sample = drawn(from, random);
    if (by_depth && !congruent(camera, sample, rule)) continue;
    ++tried;
    for (const Eigen::Isometry3d& pose :
         by_depth ? poses_of_depths(camera, sample) : poses_of_rays(camera, sample)) {
      if (!pose.matrix().allFinite()) continue;
      const double support = total_support(camera, pose, matches, rule);
      if (support <= most) continue;
      most = support;
      best = pose;
      const std::size_t inliers = inliers_of(camera, pose, matches, rule).size();
      needed = std::min(needed, draws_needed(double(inliers) / double(matches.size())));
    }
  }
  if (!best) return std::nullopt;
  best = refined(camera, *best, matches, rule);
  const MatchSet inliers = inliers_of(camera, *best, matches, rule);
  return inliers.size() < std::size_t(rule.least_inliers) ? std::nullopt : best;
}

}  // namespace gslts::reloc
