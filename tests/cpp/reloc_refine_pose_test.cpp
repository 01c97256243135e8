#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "gslts/reloc/refine_pose.hpp"
#include "raster_finite_differences.hpp"
#include "raster_scenes.hpp"

namespace gslts::reloc {
namespace {

using raster::testing::differentiate;
using raster::testing::Gaussian;
using raster::testing::map_of;
using raster::testing::Random;

/// A corner of a room: three walls of coloured tiles, soft at their edges.
template <typename T>
BasicGaussianMap<T> corner(std::uint32_t seed, double tile_m = 0.2) {
  Random random(seed);
  std::vector<Gaussian> tiles;
  constexpr double kHalf = 1.5;
  for (int axis = 0; axis < 3; ++axis) {
    for (double u = -kHalf; u < kHalf; u += tile_m) {
      for (double v = -kHalf; v < kHalf; v += tile_m) {
        Gaussian tile;
        tile.mean[axis] = axis == 2 ? 3 : kHalf;
        tile.mean[(axis + 1) % 3] = axis == 1 ? u + 1.5 : u;
        tile.mean[(axis + 2) % 3] = axis == 0 ? v + 1.5 : v;
        // Little overlap: which of two tiles is in front depends on where one looks from.
        tile.scale_m = Eigen::Vector3d::Constant(0.5 * tile_m);
        tile.scale_m[axis] = 0.1 * tile_m;
        tile.opacity = 0.95;
        for (int c = 0; c < 3; ++c) tile.color[c] = random.uniform(0.1, 0.9);
        tiles.push_back(tile);
      }
    }
  }
  return map_of<T>(tiles);
}

Eigen::Isometry3d motion_of(const Vector6& twist) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translation() = twist.head<3>();
  const double angle = twist.tail<3>().norm();
  if (angle > 0) {
    motion.linear() = Eigen::AngleAxisd(angle, twist.tail<3>() / angle).toRotationMatrix();
  }
  return motion;
}

Camera camera_of(int width, int height, const Eigen::Isometry3d& world_from_camera) {
  return camera_from_fov(width, height, 1.2, world_from_camera);
}

/// What a camera sees of a map.
template <typename T>
struct Picture {
  Picture(const BasicGaussianMap<T>& map, const Camera& at)
      : camera(at), images(raster::Rasterizer<T>().forward(map.view(), at)) {}

  RgbdView<T> view() const { return {camera, images.rgb.data(), images.depth.data(), nullptr}; }

  Camera camera;
  raster::Images<T> images;
};

/// The same in several resolutions, the coarsest first.
struct Pyramid {
  Pyramid(const GaussianMap& map, const Eigen::Isometry3d& pose, int width = 320) {
    for (const int divisor : {4, 2, 1}) {
      pictures.emplace_back(map, camera_of(width / divisor, width * 3 / 4 / divisor, pose));
    }
    for (const Picture<float>& picture : pictures) views.push_back(picture.view());
  }

  std::vector<Picture<float>> pictures;
  std::vector<RgbdView<float>> views;
};

double off_m(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm();
}

double off_rad(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle();
}

Eigen::Isometry3d some_pose(Random& random) {
  Vector6 twist;
  for (int i = 0; i < 3; ++i) twist[i] = random.uniform(-0.3, 0.3);
  for (int i = 3; i < 6; ++i) twist[i] = random.uniform(-0.2, 0.2);
  return motion_of(twist);
}

/// Askew, so that no two tiles are equally near.
const Eigen::Isometry3d kAskew = [] {
  Vector6 twist;
  twist << 0.05, -0.1, 0.1, 0.07, -0.05, 0.03;
  return motion_of(twist);
}();

/// Apart in depth, so that none passes another within a step.
std::vector<Gaussian> some_blobs(Random& random) {
  std::vector<Gaussian> blobs;
  for (int k = 0; k < 40; ++k) {
    Gaussian blob;
    blob.mean = {random.uniform(-1, 1), random.uniform(-1, 1), 1.5 + 0.05 * k};
    blob.quat_wxyz = random.quat();
    for (int i = 0; i < 3; ++i) blob.scale_m[i] = random.uniform(0.1, 0.3);
    blob.opacity = random.uniform(0.3, 0.9);
    for (int c = 0; c < 3; ++c) blob.color[c] = random.uniform(0.1, 0.9);
    blobs.push_back(blob);
  }
  return blobs;
}

/// Compares the gradient near where a picture of the map was taken with finite differences.
void expect_gradient(const BasicGaussianMap<double>& map, const Camera& camera, double off,
                     Random& random) {
  const Picture<double> picture(map, camera);
  Vector6 twist;
  for (int i = 0; i < 6; ++i) twist[i] = random.uniform(-off, off);
  const Eigen::Isometry3d elsewhere = camera.world_from_camera * motion_of(twist);
  CostRule rule;
  rule.depth_weight = 0.5;
  rule.alpha_min = 0.5;
  rule.render.alpha_min = 1e-30;  // Without the jumps where blending ends.
  rule.render.transmittance_min = 0;
  ViewCost<double> cost(map.view(), picture.view(), elsewhere, rule);
  ASSERT_GT(cost.pixels(), 100u);
  const Linearization there = cost.linearized(elsewhere);
  EXPECT_EQ(there.cost, cost.at(elsewhere));
  EXPECT_TRUE(there.curvature.allFinite());
  for (int i = 0; i < 6; ++i) {
    const auto along = [&](double amount) {
      return cost.at(elsewhere * motion_of(amount * Vector6::Unit(i)));
    };
    const double numeric = differentiate(along, 5e-5 * off).value;
    EXPECT_NEAR(there.gradient[i], numeric, 1e-4 * there.gradient.norm()) << "axis " << i;
  }
}

TEST(ViewCost, GradientIsThatOfDifferences) {
  Random random(1);
  for (int round = 0; round < 6; ++round) {
    const auto map = map_of<double>(some_blobs(random));
    expect_gradient(map, camera_of(64, 48, some_pose(random)), 0.02, random);
  }
}

TEST(ViewCost, GradientIsThatOfDifferencesAtTheExtremes) {
  Random random(2);
  const auto spoiled = [&](void (*spoil)(Gaussian&, int)) {
    std::vector<Gaussian> blobs = some_blobs(random);
    for (std::size_t k = 0; k < blobs.size(); ++k) spoil(blobs[k], int(k));
    return map_of<double>(blobs);
  };
  const Camera camera = camera_of(64, 48, Eigen::Isometry3d::Identity());
  {
    SCOPED_TRACE("a thousand kilometres from the origin of the world");
    auto map = spoiled([](Gaussian&, int) {});
    map.origin = Eigen::Vector3d(1e6, -1e6, 1e3);
    Camera away = camera;
    away.world_from_camera.translation() = map.origin;
    // Places so far away are 1e-10 m apart.
    expect_gradient(map, away, 0.2, random);
  }
  {
    SCOPED_TRACE("needles and discs");
    expect_gradient(spoiled([](Gaussian& blob, int k) { blob.scale_m[k % 3] = 1e-5; }), camera,
                    0.02, random);
  }
  {
    SCOPED_TRACE("next to nothing beside huge ones");
    const auto sized = [](Gaussian& blob, int k) { blob.scale_m *= k % 4 == 0 ? 1e-4 : 3; };
    expect_gradient(spoiled(sized), camera, 0.02, random);
  }
  {
    SCOPED_TRACE("opaque and all but transparent");
    const auto clear = [](Gaussian& blob, int k) { blob.opacity = k % 2 == 0 ? 1e-9 : 1 - 1e-9; };
    expect_gradient(spoiled(clear), camera, 0.02, random);
  }
  {
    SCOPED_TRACE("through a telescope");
    const Camera far = camera_from_fov(64, 48, 0.02, camera.world_from_camera);
    expect_gradient(spoiled([](Gaussian&, int) {}), far, 2e-4, random);
  }
}

TEST(ViewCost, CurvatureIsThatOfDifferencesNearTheOptimum) {
  const auto map = corner<double>(3);
  Random random(4);
  const Eigen::Isometry3d pose = some_pose(random);
  const Picture<double> picture(map, camera_of(160, 120, pose));
  ViewCost<double> cost(map.view(), picture.view(), pose);
  const Matrix6 curvature = cost.curvature(pose);
  EXPECT_LT((curvature - curvature.transpose()).norm(), 1e-9 * curvature.norm());
  for (int i = 0; i < 6; ++i) {
    constexpr double kStep = 5e-4;
    const double up = cost.linearized(pose * motion_of(kStep * Vector6::Unit(i))).gradient[i];
    const double down = cost.linearized(pose * motion_of(-kStep * Vector6::Unit(i))).gradient[i];
    const double numeric = (up - down) / (2 * kStep);
    // Central differences of pixels blur the slopes of the picture.
    EXPECT_GT(curvature(i, i), 0.4 * numeric) << "axis " << i;
    EXPECT_LT(curvature(i, i), 1.6 * numeric) << "axis " << i;
  }
}

TEST(ViewCost, IsLeastWhereThePictureWasTaken) {
  const auto map = corner<float>(5);
  Random random(6);
  const Eigen::Isometry3d pose = some_pose(random);
  const Picture<float> picture(map, camera_of(160, 120, pose));
  ViewCost<float> cost(map.view(), picture.view(), pose);
  EXPECT_GT(cost.fit(pose).known, 0.5);
  EXPECT_EQ(cost.fit(pose).alike, 1);
  EXPECT_EQ(cost.fit(pose).near, 1);
  const double there = cost.at(pose);
  EXPECT_LT(there, 1e-6 * double(cost.pixels()));
  for (int i = 0; i < 6; ++i) {
    for (const double amount : {-0.005, 0.005}) {
      EXPECT_GT(cost.at(pose * motion_of(amount * Vector6::Unit(i))), there + 1);
    }
  }
}

TEST(ViewCost, WhatIsHiddenByTheMaskDoesNotCount) {
  const auto map = corner<float>(7);
  const Eigen::Isometry3d pose = kAskew;
  Picture<float> picture(map, camera_of(80, 60, pose));
  std::vector<std::uint8_t> mask(80 * 60, 1);
  for (int pixel = 0; pixel < 80 * 20; ++pixel) {
    mask[pixel] = 0;
    for (int c = 0; c < 3; ++c) {
      picture.images.rgb[3 * pixel + c] = std::numeric_limits<float>::quiet_NaN();
    }
    picture.images.depth[pixel] = 0.1F;
  }
  RgbdView<float> view = picture.view();
  view.mask = mask.data();
  ViewCost<float> cost(map.view(), view, pose);
  EXPECT_LE(cost.pixels(), 80u * 40u);
  EXPECT_EQ(cost.fit(pose).known, double(cost.pixels()) / (80 * 40));
  EXPECT_LT(cost.at(pose), 1e-3);
  EXPECT_TRUE(cost.linearized(pose).gradient.allFinite());
}

TEST(RefinePose, ComesBackFromCentimetresAndDegrees) {
  const GaussianMap map = corner<float>(8);
  Random random(9);
  for (int round = 0; round < 8; ++round) {
    const Eigen::Isometry3d pose = some_pose(random);
    const Pyramid pyramid(map, pose);
    Vector6 off;  // Up to half a tile, beyond which the next one looks better.
    for (int i = 0; i < 3; ++i) off[i] = random.uniform(-0.03, 0.03);
    for (int i = 3; i < 6; ++i) off[i] = random.uniform(-0.015, 0.015);
    RefineRule rule;
    rule.iterations = 20;  // Squares of one colour tell little about some directions.
    const RefinedPose refined =
        refine_pose({map.view()}, pyramid.views, pose * motion_of(off), rule);
    EXPECT_LT(off_m(refined.world_from_camera, pose), 5e-4) << "round " << round;
    EXPECT_LT(off_rad(refined.world_from_camera, pose), 3e-4) << "round " << round;
    EXPECT_TRUE(refined.converged);
    EXPECT_GT(refined.fit.alike, 0.99);
  }
}

TEST(RefinePose, ComparesEachPictureWithItsOwnMap) {
  const GaussianMap map = corner<float>(21), nothing;
  const Pyramid pyramid(map, kAskew);
  Vector6 off;
  off << 0.005, -0.005, 0.005, 0.002, -0.002, 0.002;
  const Eigen::Isometry3d start = kAskew * motion_of(off);
  const RefinedPose by_last =
      refine_pose({nothing.view(), nothing.view(), map.view()}, pyramid.views, start);
  EXPECT_LT(off_m(by_last.world_from_camera, kAskew), 2e-3);
  EXPECT_GT(by_last.fit.alike, 0.99);
  const RefinedPose by_others =
      refine_pose({map.view(), map.view(), nothing.view()}, pyramid.views, start);
  EXPECT_LT(off_m(by_others.world_from_camera, kAskew), 2e-3);
  EXPECT_EQ(by_others.fit.known, 0);
  EXPECT_FALSE(by_others.converged);
}

TEST(RefinePose, AnotherExposureDoesNotMatter) {
  const GaussianMap map = corner<float>(10);
  Pyramid pyramid(map, kAskew);
  for (Picture<float>& picture : pyramid.pictures) {
    for (float& value : picture.images.rgb) value = 0.7F * value + 0.1F;
  }
  Vector6 off;
  off << 0.03, -0.02, 0.02, 0.01, -0.01, 0.02;
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off));
  EXPECT_LT(off_m(refined.world_from_camera, kAskew), 5e-4);
  EXPECT_GT(refined.fit.alike, 0.99);
}

TEST(RefinePose, WhatChangedSinceDoesNotPull) {
  const GaussianMap map = corner<float>(11);
  Pyramid pyramid(map, kAskew);
  for (Picture<float>& picture : pyramid.pictures) {
    const int width = picture.camera.width, height = picture.camera.height;
    for (int y = height / 4; y < 3 * height / 4; ++y) {
      for (int x = width / 4; x < width / 2; ++x) {
        const std::size_t pixel = std::size_t(y) * width + x;
        for (int c = 0; c < 3; ++c) picture.images.rgb[3 * pixel + c] = c == 0 ? 1.0F : 0.0F;
        picture.images.depth[pixel] = 1.0F;
      }
    }
  }
  Vector6 off;
  off << 0.02, 0.02, -0.02, 0.01, 0.01, 0.01;
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off));
  EXPECT_LT(off_m(refined.world_from_camera, kAskew), 2e-3);
  EXPECT_LT(refined.fit.alike, 0.95);
}

TEST(RefinePose, WorksWithoutDepth) {
  const GaussianMap map = corner<float>(12);
  Pyramid pyramid(map, kAskew);
  for (RgbdView<float>& view : pyramid.views) view.measured = nullptr;
  Vector6 off;
  off << 0.02, 0.01, -0.02, 0.01, -0.01, 0.01;
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off));
  EXPECT_LT(off_m(refined.world_from_camera, kAskew), 1e-3);
  EXPECT_EQ(refined.fit.measured, 0);
}

TEST(RefinePose, DirectionsThatAreNotSeenStayAsTheyAre) {
  // A wall of one colour, head on: moving along it changes nothing.
  std::vector<Gaussian> tiles;
  for (double u = -3; u < 3; u += 0.1) {
    for (double v = -3; v < 3; v += 0.1) {
      Gaussian tile;
      tile.mean = {u, v, 2};
      tile.scale_m = {0.08, 0.08, 0.01};
      tile.opacity = 0.95;
      tiles.push_back(tile);
    }
  }
  const GaussianMap map = map_of<float>(tiles);
  const Pyramid pyramid(map, kAskew);
  Vector6 off = Vector6::Zero();
  off << 0.03, -0.03, 0.03, 0, 0, 0;
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off));
  const Eigen::Vector3d place = (kAskew.inverse() * refined.world_from_camera).translation();
  EXPECT_TRUE(refined.world_from_camera.matrix().allFinite());
  EXPECT_LT(std::abs(place.z()), 2e-3);
  EXPECT_LT((place.head<2>() - off.head<2>()).norm(), 0.05);  // Without trust, it is a metre.
  EXPECT_LT(refined.curvature(0, 0), 1e-2 * refined.curvature(2, 2));
}

TEST(RefinePose, WhereNothingIsSeenTheStartComesBack) {
  const GaussianMap map = corner<float>(13);
  const Pyramid pyramid(map, kAskew);
  Eigen::Isometry3d away = Eigen::Isometry3d::Identity();
  away.translation() = Eigen::Vector3d(0, 0, 50);
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, away);
  EXPECT_EQ(refined.world_from_camera.matrix(), away.matrix());
  EXPECT_FALSE(refined.converged);
  EXPECT_EQ(refined.fit.known, 0);
}

TEST(RefinePose, FarFromTheOriginOfTheWorldIsAsGood) {
  GaussianMap map = corner<float>(14);
  map.origin = Eigen::Vector3d(1e5, -2e5, 3e3);
  Eigen::Isometry3d pose = kAskew;
  pose.translation() += map.origin;
  const Pyramid pyramid(map, pose);
  Vector6 off;
  off << 0.03, -0.02, 0.02, 0.01, -0.01, 0.02;
  const RefinedPose refined = refine_pose({map.view()}, pyramid.views, pose * motion_of(off));
  EXPECT_LT(off_m(refined.world_from_camera, pose), 5e-4);
}

TEST(RefinePoseDeterminism, AnyNumberOfThreadsGivesTheSameBits) {
  const GaussianMap map = corner<float>(15);
  const Pyramid pyramid(map, kAskew);
  Vector6 off;
  off << 0.03, -0.02, 0.02, 0.01, -0.01, 0.02;
  RefineRule rule;
  rule.cost.render.threads = 1;
  const RefinedPose one = refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off), rule);
  for (const int threads : {2, 5}) {
    rule.cost.render.threads = threads;
    const RefinedPose more =
        refine_pose({map.view()}, pyramid.views, kAskew * motion_of(off), rule);
    EXPECT_EQ(more.world_from_camera.matrix(), one.world_from_camera.matrix());
    EXPECT_EQ(more.curvature, one.curvature);
    EXPECT_EQ(more.cost, one.cost);
  }
}

TEST(RefinePose, RefusesWhatIsNoPictureOrNoRule) {
  const GaussianMap map = corner<float>(16, 0.5);
  const Pyramid pyramid(map, kAskew);
  const Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
  EXPECT_THROW(refine_pose({map.view()}, {}, start), std::invalid_argument);
  const std::vector<GaussianView<float>> too_many(pyramid.views.size() + 1, map.view());
  EXPECT_THROW(refine_pose(too_many, pyramid.views, start), std::invalid_argument);
  std::vector<RgbdView<float>> no_photo = pyramid.views;
  no_photo[1].photo = nullptr;
  EXPECT_THROW(refine_pose({map.view()}, no_photo, start), std::invalid_argument);
  Eigen::Isometry3d nowhere = start;
  nowhere.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(refine_pose({map.view()}, pyramid.views, nowhere), std::invalid_argument);
  for (const auto spoil : {+[](RefineRule& rule) { rule.iterations = -1; },
                           +[](RefineRule& rule) { rule.least_step_m = -1; },
                           +[](RefineRule& rule) { rule.cost.color_scale = 0; },
                           +[](RefineRule& rule) { rule.cost.depth_scale = -1; },
                           +[](RefineRule& rule) { rule.cost.depth_weight = -1; },
                           +[](RefineRule& rule) { rule.cost.alpha_min = 0; },
                           +[](RefineRule& rule) { rule.cost.render.threads = -1; }}) {
    RefineRule rule;
    spoil(rule);
    EXPECT_THROW(refine_pose({map.view()}, pyramid.views, start, rule), std::invalid_argument);
  }
}

}  // namespace
}  // namespace gslts::reloc
