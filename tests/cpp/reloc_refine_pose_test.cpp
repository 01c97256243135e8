#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "align_scenes.hpp"
#include "gslts/reloc/refine_pose.hpp"

namespace gslts::reloc {
namespace {

using align::RgbdView;
using namespace align::testing;

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
  return pose_distance(a, b).m;
}

double off_rad(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return pose_distance(a, b).rad;
}

TEST(RefinePose, ComesBackFromCentimetresAndDegrees) {
  const GaussianMap map = corner<float>(8);
  Random random(9);
  for (int round = 0; round < 8; ++round) {
    const Eigen::Isometry3d pose = some_pose(random);
    const Pyramid pyramid(map, pose);
    Vector6 off;  // Up to half a tile, beyond which the next one fits better.
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
  // Without the confidence, it is a metre.
  EXPECT_LT((place.head<2>() - off.head<2>()).norm(), 0.05);
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
                           +[](RefineRule& rule) { rule.min_step_m = -1; },
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
