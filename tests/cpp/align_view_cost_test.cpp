#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "align_scenes.hpp"
#include "gslts/align/view_cost.hpp"
#include "raster_finite_differences.hpp"

namespace gslts::align {
namespace {

using namespace testing;
using raster::testing::differentiate;

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

/// Compares the gradient near where an image of the map was taken with finite differences.
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
  const Linearization there = cost.linearize(elsewhere);
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
    const double up = cost.linearize(pose * motion_of(kStep * Vector6::Unit(i))).gradient[i];
    const double down = cost.linearize(pose * motion_of(-kStep * Vector6::Unit(i))).gradient[i];
    const double numeric = (up - down) / (2 * kStep);
    // Central differences of pixels blur the slopes of the image.
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
  EXPECT_TRUE(cost.linearize(pose).gradient.allFinite());
}

}  // namespace
}  // namespace gslts::align
