#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/fusion/register_depth.hpp"

namespace gslts::fusion {
namespace {

using Eigen::Vector3d;
using ::testing::Each;
using ::testing::HasSubstr;

constexpr int kWidth = 40, kHeight = 30;
constexpr std::size_t kSize = std::size_t(kWidth) * kHeight;

/// With a principal point that is in the middle of nothing.
Camera camera_at(const Vector3d& place) {
  Camera camera{35, 36, 21.3, 13.7, kWidth, kHeight, Eigen::Isometry3d::Identity()};
  camera.world_from_camera.translation() = place;
  return camera;
}

Camera turned(Camera camera, double angle_rad, const Vector3d& axis) {
  camera.world_from_camera.linear() =
      Eigen::AngleAxisd(angle_rad, axis.normalized()).toRotationMatrix();
  return camera;
}

/// [H,W] 1 or 3 m, in a pattern with edges, and with pixels that were not measured.
std::vector<float> steps() {
  std::vector<float> depth(kSize);
  for (int k = 0; k < int(kSize); ++k) {
    depth[k] = (k % kWidth / 7 + k / kWidth / 5) % 2 ? 3.1f : 1.7f;
    depth[k] += 0.01f * float(k % 3);
    if (k % 11 == 0) depth[k] = 0;
  }
  return depth;
}

TEST(RegisterDepth, IntoItsOwnViewChangesNoBit) {
  const Camera camera = turned(camera_at({5, -3, 2}), 1.1, {0.3, -1, 0.4});
  const std::vector<float> depth = steps();
  const Array<float> registered = register_depth(depth.data(), camera, camera);
  EXPECT_THAT(registered, testing::ElementsAreArray(depth));
}

TEST(RegisterDepth, APlaneStaysAPlane) {
  // z = 2 + 0.5 x in the first camera; the second stands beside it and is turned.
  const Camera from = camera_at({0, 0, 0});
  const Camera to = turned(camera_at({0.1, -0.05, 0.2}), 0.1, {1, 2, 3});
  const auto plane = [](const Camera& camera, int column, int row) {
    const Vector3d ray =
        camera.world_from_camera.linear() *
        Vector3d((column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, 1);
    const Vector3d place = camera.world_from_camera.translation();
    return (2 + 0.5 * place.x() - place.z()) / (ray.z() - 0.5 * ray.x());
  };
  std::vector<float> depth(kSize);
  for (int k = 0; k < int(kSize); ++k) depth[k] = float(plane(from, k % kWidth, k / kWidth));
  const Array<float> registered = register_depth(depth.data(), from, to);
  for (int row = 8; row < kHeight - 8; ++row) {
    for (int column = 8; column < kWidth - 8; ++column) {
      const double expected = plane(to, column, row);
      EXPECT_NEAR(registered[row * kWidth + column], expected, 1e-6 * expected)
          << "column " << column << ", row " << row;
    }
  }
}

TEST(RegisterDepth, TheNearestCounts) {
  // Both halves move to the left: the far one by 2 px, the near one by 7 px, before the far one.
  Camera from = camera_at({0, 0, 0}), to = camera_at({0.2, 0, 0});
  std::vector<float> depth(kSize, 3.5f);
  for (std::size_t k = 0; k < kSize; ++k) {
    if (k % kWidth >= 20) depth[k] = 1;
  }
  const Array<float> registered = register_depth(depth.data(), from, to);
  for (std::size_t k = 0; k < kSize; ++k) {
    const std::size_t column = k % kWidth;
    EXPECT_EQ(registered[k], column < 13 ? 3.5f : column < 33 ? 1.0f : 0.0f) << column;
  }
}

TEST(RegisterDepth, NothingBehindOrRightBeforeTheLensArrives) {
  const Camera from = camera_at({0, 0, 0});
  const std::vector<float> depth(kSize, 2.0f);
  for (const double forward_m : {1.97, 2.0, 3.0}) {
    EXPECT_THAT(register_depth(depth.data(), from, camera_at({0, 0, forward_m})), Each(0.0f));
  }
  const Camera back = turned(camera_at({0, 0, 0}), 3.14159265, {0, 1, 0});
  EXPECT_THAT(register_depth(depth.data(), from, back), Each(0.0f));
}

TEST(RegisterDepth, WhatWasNotMeasuredGivesNothing) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float nothing : {0.0f, -1.0f, kInf, std::numeric_limits<float>::quiet_NaN()}) {
    const std::vector<float> depth(kSize, nothing);
    const Array<float> registered =
        register_depth(depth.data(), camera_at({0, 0, 0}), camera_at({0.1, 0, 0}));
    EXPECT_THAT(registered, Each(0.0f)) << nothing;
  }
}

TEST(RegisterDepth, SurfacesSeenEdgeOnStayWithinTheirDepths) {
  // A wall from 2 to 4 m, seen along itself: where a step across it is no step in the image.
  const Camera from = camera_at({0, 0, 0});
  std::vector<float> depth(kSize);
  for (int k = 0; k < int(kSize); ++k) depth[k] = 2 + 0.05f * float(k % kWidth);
  for (int step = 0; step < 40; ++step) {
    const Camera to = turned(camera_at({-1, 0, 2}), 0.04 * step, {0, 1, 0});
    for (const float z : register_depth(depth.data(), from, to)) {
      EXPECT_TRUE(z == 0 || (z > 0.05f && z < 6)) << z;
    }
  }
}

TEST(RegisterDepth, RefusesBadCameras) {
  const Camera good = camera_at({0, 0, 0});
  Camera bad = good;
  bad.fx = 0;
  const std::vector<float> depth(kSize, 2.0f);
  for (const bool first : {true, false}) {
    try {
      register_depth(depth.data(), first ? bad : good, first ? good : bad);
      FAIL() << "nothing was thrown";
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr("register_depth: camera.fx must be positive"));
    }
  }
}

}  // namespace
}  // namespace gslts::fusion
