#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "gslts/reloc/register_clouds.hpp"

namespace gslts::reloc {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = 3.14159265358979323846 / 180;

/// [N,3]
using Points = std::vector<float>;

/// A place on one of the six sides of a box, each as likely as it is large.
Eigen::Vector3d on_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                       std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  const Eigen::Vector3d s = high - low;
  std::discrete_distribution<int> axes({s.y() * s.z(), s.z() * s.x(), s.x() * s.y()});
  Eigen::Vector3d share(uniform(random), uniform(random), uniform(random));
  const int axis = axes(random);
  share[axis] = share[axis] < 0.5 ? 0 : 1;
  return low + s.cwiseProduct(share);
}

/// The floor and two walls of a corner of 4 x 5 x 2.5 m with a table and a cupboard, measured to
/// 4 mm: `count` points of those with x in the given range.
Points room(std::size_t count, unsigned seed, double from_x = 0, double to_x = 4) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> noise(0, 0.004);
  std::discrete_distribution<int> parts({20, 10, 12.5, 5, 7});
  Points points;
  while (points.size() < 3 * count) {
    const double u = uniform(random), v = uniform(random);
    Eigen::Vector3d point;
    switch (parts(random)) {
      case 0:
        point = {4 * u, 5 * v, 0};
        break;
      case 1:
        point = {4 * u, 0, 2.5 * v};
        break;
      case 2:
        point = {0, 5 * u, 2.5 * v};
        break;
      case 3:
        point = on_box({1, 1.5, 0.6}, {2.2, 2.2, 0.75}, random);
        break;
      default:
        point = on_box({2.8, 0, 0}, {3.6, 0.5, 1.8}, random);
    }
    if (point.x() < from_x || point.x() > to_x) continue;
    for (int k = 0; k < 3; ++k) points.push_back(float(point[k] + noise(random)));
  }
  return points;
}

Points moved(Points points, const Eigen::Isometry3d& motion) {
  for (std::size_t i = 0; i < points.size(); i += 3) {
    Eigen::Map<Eigen::Vector3f> point(&points[i]);
    point = (motion * point.cast<double>()).cast<float>();
  }
  return points;
}

/// A turn about the middle of the room, and then a shift.
Eigen::Isometry3d motion_of(double angle_rad, const Eigen::Vector3d& axis,
                            const Eigen::Vector3d& shift_m) {
  const Eigen::Translation3d middle(2, 2.5, 1);
  return Eigen::Translation3d(shift_m) * middle * Eigen::AngleAxisd(angle_rad, axis.normalized()) *
         middle.inverse();
}

/// 5 cm and 4 degrees.
Eigen::Isometry3d some_motion() { return motion_of(4 * kDegree, {1, -2, 3}, {0.03, -0.03, 0.026}); }

Registration registered(const Points& source, const Points& target,
                        const Eigen::Isometry3d& guess = Eigen::Isometry3d::Identity(),
                        const CloudRule& rule = {}) {
  return register_clouds(source.data(), source.size() / 3, target.data(), target.size() / 3, guess,
                         rule);
}

/// To 3 mm, in the middle of the room, and 0.2 degrees.
void expect_near(const Eigen::Isometry3d& found, const Eigen::Isometry3d& expected,
                 const Eigen::Vector3d& middle = {2, 2.5, 1}) {
  EXPECT_LT((found * middle - expected * middle).norm(), 0.003);
  const Eigen::AngleAxisd turn(expected.linear().transpose() * found.linear());
  EXPECT_LT(turn.angle() / kDegree, 0.2);
}

std::string message_of(const Points& source, const Points& target, const CloudRule& rule = {},
                       const Eigen::Isometry3d& guess = Eigen::Isometry3d::Identity()) {
  try {
    registered(source, target, guess, rule);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(RegisterClouds, BringsARoomBack) {
  const Eigen::Isometry3d expected = some_motion();
  const Registration found = registered(room(8000, 1), moved(room(16000, 2), expected));
  EXPECT_TRUE(found.converged);
  expect_near(found.target_from_source, expected);
  EXPECT_GT(found.overlap, 0.99);
  EXPECT_LT(found.rms_m, 0.01);
}

TEST(RegisterClouds, BringsItThereAsWell) {
  const Eigen::Isometry3d expected = some_motion().inverse();
  const Registration found = registered(moved(room(8000, 1), some_motion()), room(16000, 2));
  EXPECT_TRUE(found.converged);
  expect_near(found.target_from_source, expected);
}

TEST(RegisterClouds, TheGuessIsWhereItStarts) {
  const Eigen::Isometry3d far = motion_of(2.5, {0.2, 0.3, 1}, {7, -4, 2});
  const Registration found =
      registered(room(8000, 1), moved(room(16000, 2), far), far * some_motion());
  EXPECT_TRUE(found.converged);
  expect_near(found.target_from_source, far);
}

TEST(RegisterClouds, WhatTheyShareBringsThemTogether) {
  const Eigen::Isometry3d expected = some_motion();
  const Registration found =
      registered(room(8000, 1, 0, 2.8), moved(room(16000, 2, 1.2, 4), expected));
  EXPECT_TRUE(found.converged);
  expect_near(found.target_from_source, expected);
  EXPECT_GT(found.overlap, 0.3);
  EXPECT_LT(found.overlap, 0.8);
}

TEST(RegisterClouds, OtherRoomsShareLittle) {
  const Eigen::Isometry3d away(Eigen::Translation3d(20, 0, 0));
  const Registration found = registered(room(4000, 1), moved(room(8000, 2), away));
  EXPECT_FALSE(found.converged);
  EXPECT_EQ(found.overlap, 0);
  EXPECT_EQ(found.rms_m, 0);
  EXPECT_EQ(found.target_from_source.matrix(), Eigen::Matrix4d::Identity());
}

TEST(RegisterClouds, OfFewPointsTheGuessComesBack) {
  const Eigen::Isometry3d guess = some_motion();
  const Points many = room(4000, 1), three = {1, 1, 0, 2, 1, 0, 1, 2, 0};
  const std::vector<std::pair<Points, Points>> pairs = {
      {{}, {}}, {{}, many}, {many, {}}, {three, many}, {many, three}, {three, three}};
  for (const auto& [source, target] : pairs) {
    const Registration found = registered(source, target, guess);
    EXPECT_FALSE(found.converged);
    EXPECT_EQ(found.target_from_source.matrix(), guess.matrix());
    EXPECT_EQ(found.overlap, 0);
    EXPECT_EQ(found.rms_m, 0);
  }
}

TEST(RegisterClouds, OneVoxelIsFewPoints) {
  const Points same(300, 1.0f);
  const Registration found = registered(same, same);
  EXPECT_FALSE(found.converged);
  EXPECT_EQ(found.target_from_source.matrix(), Eigen::Matrix4d::Identity());
}

TEST(RegisterClouds, APlaneHoldsAcrossItself) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(0, 3);
  Points source, target;
  for (int i = 0; i < 8000; ++i) {
    for (Points* points : {&source, &target}) {
      points->insert(points->end(),
                     {uniform(random), uniform(random), points == &target ? 0.04f : 0});
    }
  }
  const Registration found = registered(source, target);
  ASSERT_TRUE(found.target_from_source.matrix().allFinite());
  const Eigen::Vector3d middle(1.5, 1.5, 0);
  const Eigen::Vector3d shift = found.target_from_source * middle - middle;
  EXPECT_NEAR(shift.z(), 0.04, 0.001);
  EXPECT_LT(shift.head<2>().norm(), 0.05);
}

TEST(RegisterClouds, ALineIsFinite) {
  Points line;
  for (int i = 0; i < 1000; ++i) line.insert(line.end(), {0.01f * float(i), 0, 0});
  const Registration found = registered(line, line, some_motion());
  EXPECT_TRUE(found.target_from_source.matrix().allFinite());
}

TEST(RegisterClouds, FarAwayIsAsGoodAsNear) {
  const Eigen::Isometry3d away(Eigen::Translation3d(1000, -1000, 300)), expected = some_motion();
  const Points source = room(8000, 1), target = moved(room(16000, 2), expected);
  const Registration near = registered(source, target),
                     far = registered(moved(source, away), moved(target, away));
  EXPECT_TRUE(far.converged);
  expect_near(far.target_from_source, away * expected * away.inverse(),
              away * Eigen::Vector3d(2, 2.5, 1));
  EXPECT_NEAR(far.overlap, near.overlap, 1e-3);
  EXPECT_NEAR(far.rms_m, near.rms_m, 1e-3);
}

TEST(RegisterClouds, PointsFarOutsideOfTheSourceDoNotCount) {
  const Eigen::Isometry3d expected = some_motion();
  const Points source = room(8000, 1), target = moved(room(16000, 2), expected);
  Points more = target;
  more.insert(more.end(), {1e30f, 0, 0, -5e8f, 3, 3, 1000, 1000, 1000});
  const Registration alone = registered(source, target), among = registered(source, more);
  EXPECT_EQ(among.target_from_source.matrix(), alone.target_from_source.matrix());
}

TEST(RegisterClouds, IterationsRunOut) {
  CloudRule once;
  once.iterations = 1;
  const Registration found =
      registered(room(4000, 1), moved(room(8000, 2), some_motion()), some_motion(), once);
  EXPECT_FALSE(found.converged);
  expect_near(found.target_from_source, some_motion());
}

TEST(RegisterClouds, AreDeterministic) {
  const Points source = room(6000, 1), target = moved(room(12000, 2), some_motion());
  const Registration first = registered(source, target), second = registered(source, target);
  EXPECT_EQ(first.target_from_source.matrix(), second.target_from_source.matrix());
  EXPECT_EQ(first.overlap, second.overlap);
  EXPECT_EQ(first.rms_m, second.rms_m);
}

TEST(RegisterClouds, PrintNothing) {
  const Points many = room(2000, 1), three = {1, 1, 0, 2, 1, 0, 1, 2, 0};
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  registered(many, many);
  registered(three, many);
  registered({}, many);
  registered(many, moved(many, Eigen::Isometry3d(Eigen::Translation3d(0, 0, 3))));
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(RegisterCloudsErrors, NameWhatIsWrong) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Points points = room(100, 1), bad = {0, 0, 0, 0, nan, 0};
  EXPECT_THAT(message_of(bad, points), HasSubstr("register_clouds: source[1] is not finite"));
  EXPECT_THAT(message_of(points, bad), HasSubstr("register_clouds: target[1] is not finite"));
  EXPECT_THAT(message_of({0, 0, 0, 1e6f, 1e6f, 1e6f}, points),
              HasSubstr("register_clouds: source spans 8e+21 voxels of 0.05 m"));
  CloudRule rule;
  rule.voxel_m = 0;
  EXPECT_THAT(message_of(points, points, rule), HasSubstr("voxel_m must be in 1e-4..10, got 0"));
  rule = {};
  rule.max_distance_m = double(nan);
  EXPECT_THAT(message_of(points, points, rule), HasSubstr("max_distance_m must be in (0, 100]"));
  rule = {};
  rule.neighbours = 3;
  EXPECT_THAT(message_of(points, points, rule), HasSubstr("neighbours must be at least 4, got 3"));
  rule = {};
  rule.iterations = 0;
  EXPECT_THAT(message_of(points, points, rule), HasSubstr("iterations must be positive, got 0"));
  Eigen::Isometry3d guess = Eigen::Isometry3d::Identity();
  guess.matrix()(0, 3) = double(nan);
  EXPECT_THAT(message_of(points, points, {}, guess),
              HasSubstr("guess must be a finite rigid motion"));
  guess = Eigen::Isometry3d::Identity();
  guess.matrix()(2, 2) = -1;
  EXPECT_THAT(message_of(points, points, {}, guess),
              HasSubstr("guess must be a finite rigid motion"));
}

}  // namespace
}  // namespace gslts::reloc
