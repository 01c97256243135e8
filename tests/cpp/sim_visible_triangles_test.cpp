#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "gslts/sim/triangle_hits.hpp"
#include "gslts/sim/visible_triangles.hpp"

namespace gslts::sim {
namespace {

using Eigen::Vector3d;
using Corners = std::vector<float>;  // [T,3,3]

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<std::uint32_t> rasterized(const Camera& camera, const Corners& corners) {
  const auto one = visible_triangles(camera, corners.data(), corners.size() / 9, 1);
  for (const int threads : {2, 3}) {
    EXPECT_EQ(one, visible_triangles(camera, corners.data(), corners.size() / 9, threads));
  }
  return {one.begin(), one.end()};
}

Vector3d corner(const Corners& corners, std::size_t triangle, std::size_t k) {
  const float* numbers = corners.data() + 9 * triangle + 3 * k;
  return {numbers[0], numbers[1], numbers[2]};
}

void add(Corners& corners, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  for (const Vector3d& point : {a, b, c}) {
    for (int k = 0; k < 3; ++k) corners.push_back(float(point[k]));
  }
}

/// Depth at which the ray of a pixel centre meets a triangle whose barycentric weights there are
/// all above `least_weight`; infinite if none. Cramer's rule.
double depth_at(const Camera& camera, std::size_t pixel, const Corners& corners,
                std::size_t triangle, double least_weight) {
  const double column = double(pixel % std::size_t(camera.width)) + 0.5;
  const double row = double(pixel / std::size_t(camera.width)) + 0.5;
  const Vector3d way = camera.world_from_camera.linear() *
                       Vector3d((column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, 1);
  const Vector3d eye = camera.world_from_camera.translation().cast<float>().cast<double>();
  const Vector3d a = corner(corners, triangle, 0);
  Eigen::Matrix3d system;
  system << corner(corners, triangle, 1) - a, corner(corners, triangle, 2) - a, -way;
  if (std::abs(system.determinant()) < 1e-12) return kInfinity;
  const Vector3d solution = system.inverse() * (eye - a);
  const double v = solution[0], w = solution[1], depth = solution[2];
  return std::min({v, w, 1 - v - w}) > least_weight && depth > 0 ? depth : kInfinity;
}

/// Checks each pixel against all triangles.
/// @return  Number of pixels that show a triangle.
int compare_with_all_triangles(const Camera& camera, const Corners& corners) {
  const std::vector<std::uint32_t> found = rasterized(camera, corners);
  int hits = 0;
  for (std::size_t pixel = 0; pixel < found.size(); ++pixel) {
    double nearest = kInfinity;  // Of those that the ray hits off their edges.
    for (std::size_t k = 0; k < corners.size() / 9; ++k) {
      nearest = std::min(nearest, depth_at(camera, pixel, corners, k, 1e-6));
    }
    if (found[pixel] == kNoTriangle) {
      EXPECT_EQ(nearest, kInfinity) << "pixel " << pixel;
      continue;
    }
    ++hits;
    const double depth = depth_at(camera, pixel, corners, found[pixel], -1e-6);
    EXPECT_LT(depth, kInfinity) << "pixel " << pixel;
    EXPECT_LE(depth, nearest * (1 + 1e-5)) << "pixel " << pixel;
  }
  return hits;
}

Camera tilted_camera(const Vector3d& eye, int width = 41, int height = 33) {
  return {25, 30, 18.3, 20.1, width, height, look_at(eye, {0.3, -0.2, 0.1})};
}

TEST(VisibleTriangles, AreThoseOfASearchThroughAll) {
  std::mt19937 random(0);
  std::uniform_real_distribution<double> place(-2, 2);
  std::uniform_real_distribution<double> log_size(-4, 1.5);
  const auto vector = [&] { return Vector3d(place(random), place(random), place(random)); };
  int hits = 0;
  for (int scene = 0; scene < 30; ++scene) {
    // Some are around the camera, so that its plane cuts them, and some are slivers.
    Corners corners;
    for (int k = 0; k < 60; ++k) {
      const Vector3d center = vector();
      const double size = std::exp(log_size(random)), length = std::exp(log_size(random));
      add(corners, center, center + size * vector(), center + length * vector());
    }
    hits += compare_with_all_triangles(tilted_camera(vector()), corners);
  }
  EXPECT_GT(hits, 10000);
  EXPECT_LT(hits, 35000);
}

TEST(VisibleTriangles, FloorUnderTheCameraReachesTheHorizon) {
  Corners corners;
  add(corners, {-1e4, -1e4, 0}, {1e4, -1e4, 0}, {0, 2e4, 0});
  const Camera camera = camera_from_fov(8, 6, 1.5, look_at({0, 0, 1.5}, {1, 0, 1.5}));
  const std::vector<std::uint32_t> found = rasterized(camera, corners);
  for (std::size_t pixel = 0; pixel < found.size(); ++pixel) {
    EXPECT_EQ(found[pixel], pixel < 24 ? kNoTriangle : 0);
  }
}

TEST(VisibleTriangles, CameraInABoxSeesNoGap) {
  Corners corners;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const auto point = [&](double u, double v) {
        Vector3d result;
        result[axis] = side, result[(axis + 1) % 3] = u, result[(axis + 2) % 3] = v;
        return result;
      };
      add(corners, point(-1, -1), point(1, -1), point(1, 1));
      add(corners, point(-1, -1), point(1, 1), point(-1, 1));
    }
  }
  // The first camera has pixel centres exactly on edges and diagonals.
  Camera camera{4, 4, 8.5, 8.5, 17, 17, Eigen::Isometry3d::Identity()};
  EXPECT_EQ(compare_with_all_triangles(camera, corners), 17 * 17);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-0.99, 0.99);
  for (int k = 0; k < 30; ++k) {
    camera = tilted_camera({place(random), place(random), place(random)});
    EXPECT_EQ(compare_with_all_triangles(camera, corners), 41 * 33);
  }
}

TEST(VisibleTriangles, TrianglesWithoutAreaOrInViewOnlyByTheirEdgeAreInvisible) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Camera camera{4, 4, 4.5, 4.5, 9, 9, Eigen::Isometry3d::Identity()};
  Corners corners;
  add(corners, {0, 0, 1}, {0, 0, 1}, {0, 0, 1});
  add(corners, {-1, 0, 1}, {0, 0, 1}, {1, 0, 1});
  add(corners, {-1, 0, 1}, {1, 0, 1}, {0, 0, 2});       // In a plane through the eye.
  add(corners, {0, 0, 0}, {1, 0, 1}, {0, 1, 1});        // A corner at the eye.
  add(corners, {-9, -9, -1}, {9, -9, -1}, {0, 9, -1});  // Behind.
  add(corners, {-9, -9, 0}, {9, -9, 0}, {0, 9, 0});     // In the plane of the camera.
  add(corners, {nan, -9, 1}, {9, -9, 1}, {0, 9, 1});
  for (const std::uint32_t index : rasterized(camera, corners)) EXPECT_EQ(index, kNoTriangle);
}

TEST(VisibleTriangles, TableTopAtTheHeightOfTheEyeIsInvisible) {
  Corners corners;
  add(corners, {-3, 5, 1.5}, {7, 5, 1.5}, {1, 1, 1.5});
  // The ray of the middle pixel lies in its plane, but for rounding.
  Camera camera{4, 4, 4.5, 4.5, 9, 9, Eigen::Isometry3d::Identity()};
  for (int k = 0; k < 200; ++k) {
    camera.world_from_camera = look_at({0.3, 0.4, 1.5}, {1, 2 + 0.01 * k, 1.5});
    camera.world_from_camera.rotate(Eigen::AngleAxisd(0.03 * k, Vector3d::UnitZ()));
    EXPECT_EQ(rasterized(camera, corners), std::vector<std::uint32_t>(81, kNoTriangle));
  }
}

TEST(VisibleTriangles, EdgeAlmostAlongARowOfPixelCentresHidesIt) {
  Corners corners;
  add(corners, {-9, 1e-5, 1}, {9, 1e-5, 1}, {0, 99, 1});
  for (const double angle : {0.0, 1e-15, -1e-15}) {
    Camera camera{4, 4, 4.5, 4.5, 9, 9, Eigen::Isometry3d::Identity()};
    camera.world_from_camera.rotate(Eigen::AngleAxisd(angle, Vector3d::UnitZ()));
    const std::vector<std::uint32_t> found = rasterized(camera, corners);
    for (std::size_t pixel = 0; pixel < found.size(); ++pixel) {
      EXPECT_EQ(found[pixel], pixel < 45 ? kNoTriangle : 0);
    }
  }
}

TEST(VisibleTriangles, EmptySceneShowsNothing) {
  for (const std::uint32_t index : rasterized(tilted_camera({1, 1, 1}), {})) {
    EXPECT_EQ(index, kNoTriangle);
  }
}

TEST(VisibleTriangles, OfCoincidentTrianglesTheFirstIsVisible) {
  // Rotated, so that their planes differ by the rounding of their corners.
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  Corners corners;
  const auto add_at = [&](double z, double size) {
    add(corners, rotation * Vector3d(-size, -size, z), rotation * Vector3d(size, -size, z),
        rotation * Vector3d(0, size, z));
  };
  for (int k = 0; k < 10; ++k) add_at(2, 8 + k);
  add_at(1.9999, 0.3);
  Camera camera{40, 40, 20, 20, 40, 40, Eigen::Isometry3d::Identity()};
  camera.world_from_camera.linear() = rotation;
  const std::vector<std::uint32_t> found = rasterized(camera, corners);
  const auto nearer = std::count(found.begin(), found.end(), 10u);
  EXPECT_GT(nearer, 20);
  EXPECT_EQ(std::count(found.begin(), found.end(), 0u) + nearer, 1600);
}

TEST(VisibleTriangles, BadArgumentsAreErrors) {
  EXPECT_THROW(visible_triangles(tilted_camera({1, 1, 1}, 0), nullptr, 0, 1),
               std::invalid_argument);
  EXPECT_THROW(visible_triangles(tilted_camera({1, 1, 1}), nullptr, 0, -1), std::invalid_argument);
}

}  // namespace
}  // namespace gslts::sim
