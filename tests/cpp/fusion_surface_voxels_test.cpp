#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/fusion/surface_voxels.hpp"

namespace gslts::fusion {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Sums = Eigen::Matrix<double, kVoxelSums, 1>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

struct Picture {
  Camera camera;
  std::vector<float> depth;
  std::vector<std::uint8_t> rgb;
  std::vector<std::uint8_t> mask;
};

void add(SurfaceVoxels& voxels, const Picture& picture) {
  voxels.add(picture.depth.data(), picture.rgb.data(), picture.camera,
             picture.mask.empty() ? nullptr : picture.mask.data());
}

Sums sums_of(const VoxelSums& voxels, std::size_t row) {
  return Eigen::Map<const Sums>(voxels.sums.data() + row * kVoxelSums);
}

/// Sums over all voxels.
Sums total(const VoxelSums& voxels) {
  Sums result = Sums::Zero();
  for (std::size_t i = 0; i < voxels.keys.size(); ++i) result += sums_of(voxels, i);
  return result;
}

double count(const VoxelSums& voxels) { return total(voxels)[0]; }

/// A wall 2 m in front of a camera that is the world, 9 x 9 px; its red rises to the right by 10
/// and its blue downwards by 4 each pixel.
Picture wall() {
  Picture picture{{100, 50, -10, -20, 9, 9, Eigen::Isometry3d::Identity()}, {}, {}, {}};
  picture.depth.assign(81, 2.0f);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x) {
      picture.rgb.insert(picture.rgb.end(), {std::uint8_t(10 * x), 7, std::uint8_t(4 * y)});
    }
  }
  return picture;
}

/// The floor, z = 0, and a step in it, seen from above at a slant.
Picture floor_seen_from(const Eigen::Vector3d& eye, double floor_z = 0) {
  const Eigen::Vector3d target = {eye.x() + 0.9, eye.y() + 0.4, floor_z};
  Picture picture{camera_from_fov(64, 48, 1.0, look_at(eye, target)), {}, {}, {}};
  const Camera& camera = picture.camera;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray =
          camera.world_from_camera.linear() *
          Eigen::Vector3d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1);
      picture.depth.push_back(float((floor_z - eye.z()) / ray.z()));
      picture.rgb.insert(picture.rgb.end(),
                         {std::uint8_t(3 * x), std::uint8_t(5 * y), std::uint8_t(x + y)});
    }
  }
  return picture;
}

/// Sums of the voxels whose mean positions lie in the same cube.
std::map<std::array<double, 3>, Sums> by_cube(const Array<double>& sums, double edge_m) {
  std::map<std::array<double, 3>, Sums> result;
  for (std::size_t i = 0; i < sums.size(); i += kVoxelSums) {
    const Sums voxel = Eigen::Map<const Sums>(sums.data() + i);
    const Eigen::Array3d cube = (voxel.segment<3>(1) / voxel[0] / edge_m).array().floor();
    const auto place = result.try_emplace({cube.x(), cube.y(), cube.z()}, Sums::Zero()).first;
    place->second += voxel;
  }
  return result;
}

template <typename Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(SurfaceVoxels, SumsOfAWall) {
  SurfaceVoxels surface(10.0, 2);
  add(surface, wall());
  const VoxelSums voxels = surface.voxels();
  ASSERT_EQ(voxels.keys.size(), 1u);
  EXPECT_THAT(voxels.hits, ElementsAre(1));
  const Sums sums = sums_of(voxels, 0);
  // Of rows and columns 0, 2, 4, 6, 8 those that have neighbours: 2, 4 and 6.
  EXPECT_EQ(sums[0], 9);
  EXPECT_NEAR(sums[1] / 9, (4.5 + 10) / 100 * 2, 1e-12);
  EXPECT_NEAR(sums[2] / 9, (4.5 + 20) / 50 * 2, 1e-12);
  EXPECT_NEAR(sums[3] / 9, 2, 1e-12);
  EXPECT_TRUE(sums.segment<3>(4).isApprox(Eigen::Vector3d(0, 0, -9), 1e-12));
  EXPECT_TRUE((sums.segment<3>(7) / 9).isApprox(Eigen::Vector3d(40, 7, 16) / 255, 1e-12));
  // Each pixel is 2 m / 100 px wide and 2 m / 50 px high.
  const double per_m = std::hypot(10 * 100, 4 * 50) / 3 / 255 / 2;
  EXPECT_NEAR(sums[10] / 9, per_m * per_m, 1e-12);
}

TEST(SurfaceVoxels, EveryPixelStepCounts) {
  const auto counted = [](int step) {
    SurfaceVoxels surface(10.0, step);
    add(surface, wall());
    return count(surface.voxels());
  };
  EXPECT_EQ(counted(1), 49);
  EXPECT_EQ(counted(3), 1);  // 0, 3 and 6 each way.
  EXPECT_EQ(counted(4), 1);
  EXPECT_EQ(counted(5), 0);
  EXPECT_EQ(counted(std::numeric_limits<int>::max()), 0);
}

TEST(SurfaceVoxels, NormalsPointUpFromAFloorSeenFromAbove) {
  const Picture picture = floor_seen_from({0.3, -0.2, 1.5});
  SurfaceVoxels surface(0.1, 2);
  add(surface, picture);
  const VoxelSums voxels = surface.voxels();
  ASSERT_GT(voxels.keys.size(), 50u);
  for (std::size_t i = 0; i < voxels.keys.size(); ++i) {
    const Sums mean = sums_of(voxels, i) / sums_of(voxels, i)[0];
    EXPECT_NEAR(mean[3], 0, 1e-6);
    EXPECT_GT(mean[6], 0.99999);
  }
}

TEST(SurfaceVoxels, AVoxelHoldsThePointsOfItsCube) {
  SurfaceVoxels surface(0.1, 2);
  add(surface, floor_seen_from({0.3, -0.2, 1.53}, 0.05));
  const VoxelSums voxels = surface.voxels();
  EXPECT_EQ(by_cube(voxels.sums, 0.1).size(), voxels.keys.size()) << "no cube twice";
}

TEST(SurfaceVoxels, WhatHasNoNeighboursIsNoSurface) {
  const auto left = [](std::size_t pixel, float depth) {
    Picture picture = wall();
    picture.depth[pixel] = depth;
    SurfaceVoxels surface(10.0, 2);
    add(surface, picture);
    return 9 - count(surface.voxels());
  };
  constexpr std::size_t kMiddle = 4 * 9 + 4, kSide = 4 * 9, kUnused = 3 * 9 + 4;
  EXPECT_EQ(left(kMiddle, 0.0f), 5);
  EXPECT_EQ(left(kMiddle, kNan), 5);
  EXPECT_EQ(left(kMiddle, 2.2f), 5) << "a step of more than 5 %";
  EXPECT_EQ(left(kMiddle, 2.08f), 0);
  EXPECT_EQ(left(kSide, 0.0f), 1);
  EXPECT_EQ(left(kUnused, 0.0f), 0);
}

TEST(SurfaceVoxels, WhatTheMaskHidesIsNoSurface) {
  Picture picture = wall();
  picture.mask.assign(81, 1);
  picture.mask[4 * 9 + 4] = 0;
  picture.depth[4 * 9 + 4] = kInf;  // Whatever stands there.
  picture.mask[3 * 9 + 4] = 0;      // Between the pixels that are sampled.
  SurfaceVoxels surface(10.0, 2);
  add(surface, picture);
  EXPECT_EQ(count(surface.voxels()), 4);
}

TEST(SurfaceVoxels, HitsCountFramesNotPoints) {
  SurfaceVoxels surface(10.0, 2);
  Picture empty = wall();
  empty.depth.assign(81, 0.0f);
  add(surface, wall());
  add(surface, empty);
  add(surface, wall());
  EXPECT_THAT(surface.voxels().hits, ElementsAre(2));
  EXPECT_EQ(count(surface.voxels()), 18);
}

TEST(SurfaceVoxels, FramesWithoutPointsLeaveNoVoxels) {
  SurfaceVoxels surface(0.1, 2);
  EXPECT_TRUE(surface.voxels().keys.empty());
  for (const int size : {1, 2, 3, 4}) {
    Picture picture = wall();
    picture.camera.width = picture.camera.height = size;
    add(surface, picture);
  }
  EXPECT_TRUE(surface.voxels().keys.empty());
  EXPECT_TRUE(surface.voxels().sums.empty());
}

TEST(SurfaceVoxels, EightPartsShareTheShiftedKey) {
  // On both sides of the world's origin.
  SurfaceVoxels fine(0.05, 1), coarse(0.1, 1);
  for (const Eigen::Vector3d& eye : {Eigen::Vector3d(-0.9, -0.2, 1.5), {-0.5, -0.3, 1.4}}) {
    add(fine, floor_seen_from(eye, 0.01));
    add(coarse, floor_seen_from(eye, 0.01));
  }
  const VoxelSums parts = fine.voxels();
  Array<double> sums;
  for (std::size_t i = 0; i < parts.keys.size(); ++i) {
    if (i > 0) {
      EXPECT_LT(parts.keys[i - 1], parts.keys[i]);
    }
    if (i == 0 || parts.keys[i] >> 3 != parts.keys[i - 1] >> 3)
      sums.resize(sums.size() + kVoxelSums, 0.0);
    Eigen::Map<Sums>(sums.data() + sums.size() - kVoxelSums) += sums_of(parts, i);
  }
  const auto grouped = by_cube(sums, 0.1), wholes = by_cube(coarse.voxels().sums, 0.1);
  ASSERT_EQ(sums.size(), grouped.size() * kVoxelSums) << "a voxel of twice the edge occurs twice";
  ASSERT_LT(grouped.size(), 0.5 * double(parts.keys.size()));
  ASSERT_EQ(grouped.size(), wholes.size());
  for (const auto& [cube, whole] : wholes) {
    ASSERT_EQ(grouped.count(cube), 1u);
    EXPECT_TRUE(grouped.at(cube).isApprox(whole, 1e-12));
  }
}

TEST(SurfaceVoxels, TheOrderOfFramesChangesNothingButRounding) {
  const Picture one = floor_seen_from({0.3, 0.2, 1.5}, 0.01);
  const Picture other = floor_seen_from({0.5, 0.3, 1.4}, 0.01);
  SurfaceVoxels there(0.05, 2), back(0.05, 2);
  add(there, one);
  add(there, other);
  add(back, other);
  add(back, one);
  const VoxelSums a = there.voxels(), b = back.voxels();
  EXPECT_EQ(a.keys, b.keys);
  EXPECT_EQ(a.hits, b.hits);
  for (std::size_t i = 0; i < a.keys.size(); ++i) {
    EXPECT_TRUE(sums_of(a, i).isApprox(sums_of(b, i), 1e-12)) << i;
  }
}

TEST(SurfaceVoxels, TheSameFramesGiveTheSameBits) {
  const auto fused = [] {
    SurfaceVoxels surface(0.03, 2);
    add(surface, floor_seen_from({0.3, 0.2, 1.5}));
    add(surface, floor_seen_from({0.5, 0.3, 1.4}));
    return surface.voxels();
  };
  const VoxelSums a = fused(), b = fused();
  EXPECT_EQ(a.keys, b.keys);
  EXPECT_EQ(a.sums, b.sums);
  EXPECT_EQ(a.hits, b.hits);
}

TEST(SurfaceVoxels, FarFromTheOriginNothingIsLost) {
  const Eigen::Vector3d eye(0.3, 0.2, 1.5), far(1e6, -2e6, 5e5);
  // 0.0625 divides the shift, and both are exact.
  SurfaceVoxels near_by(0.0625, 2), far_away(0.0625, 2);
  Picture picture = floor_seen_from(eye, 0.01);
  for (int i = 0; i < 50; ++i) add(near_by, picture);
  picture.camera.world_from_camera.translation() += far;
  for (int i = 0; i < 50; ++i) add(far_away, picture);
  const VoxelSums a = near_by.voxels(), b = far_away.voxels();
  ASSERT_EQ(a.keys.size(), b.keys.size());
  for (std::size_t i = 0; i < a.keys.size(); ++i) {
    Sums here = sums_of(a, i) / sums_of(a, i)[0];
    const Sums there = sums_of(b, i) / sums_of(b, i)[0];
    here.segment<3>(1) += far;
    EXPECT_LT((here - there).cwiseAbs().maxCoeff(), 2e-9) << i;
  }
}

TEST(SurfaceVoxelsErrors, BadEdgesAndStepsAreNamed) {
  for (const double edge_m : {0.0, -0.1, double(kNan), double(kInf)}) {
    EXPECT_THAT(error_of([&] { SurfaceVoxels(edge_m, 2); }),
                HasSubstr("edge_m must be positive and finite, got"));
  }
  EXPECT_THAT(error_of([] { SurfaceVoxels(0.1, 0); }), HasSubstr("at least 1, got 0"));
}

TEST(SurfaceVoxelsErrors, BadDepthsAndCamerasAreNamed) {
  SurfaceVoxels surface(0.1, 2);
  Picture picture = wall();
  picture.depth[4 * 9 + 6] = kInf;
  EXPECT_THAT(error_of([&] { add(surface, picture); }), HasSubstr("got inf in row 4, column 6"));
  picture.depth[4 * 9 + 6] = -1.0f;
  EXPECT_THAT(error_of([&] { add(surface, picture); }), HasSubstr("got -1 in row 4, column 6"));
  picture = wall();
  picture.camera.fx = 0;
  EXPECT_THAT(error_of([&] { add(surface, picture); }), HasSubstr("camera.fx"));
  EXPECT_TRUE(surface.voxels().keys.empty());
}

TEST(SurfaceVoxelsErrors, WhatIsTooFarIsNamedAndNothingIsAdded) {
  SurfaceVoxels surface(0.1, 2);
  add(surface, wall());
  const VoxelSums before = surface.voxels();
  // The last points of a frame only; then a whole one; then one beyond all doubles.
  Picture picture = wall();
  for (std::size_t i = 54; i < 81; ++i) picture.depth[i] = 1.2e5f;
  for (std::size_t i = 36; i < 54; ++i) picture.depth[i] = 1.15e5f;
  for (std::size_t i = 0; i < 36; ++i) picture.depth[i] = 2.0f;
  EXPECT_THAT(error_of([&] { add(surface, picture); }), HasSubstr("too far from the first camera"));
  picture.depth.assign(81, 3e38f);
  EXPECT_THAT(error_of([&] { add(surface, picture); }), HasSubstr("too far from the first camera"));
  picture = wall();
  for (const double x : {1.1e5, -1.1e5, 1e300}) {
    picture.camera.world_from_camera.translation().x() = x;
    EXPECT_THAT(error_of([&] { add(surface, picture); }),
                HasSubstr("too far from the first camera"));
  }
  EXPECT_EQ(surface.voxels().sums, before.sums);
  EXPECT_EQ(surface.voxels().hits, before.hits);
  SurfaceVoxels other(0.1, 2);
  EXPECT_THAT(error_of([&] { add(other, picture); }), HasSubstr("too far from the world's origin"));
  add(other, wall());
  EXPECT_EQ(other.voxels().sums, before.sums);
}

}  // namespace
}  // namespace gslts::fusion
