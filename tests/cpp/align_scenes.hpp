#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "gslts/align/view_cost.hpp"
#include "raster_scenes.hpp"

namespace gslts::align::testing {

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
        // Little overlap: which of two tiles is in front depends on the viewpoint.
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

inline Eigen::Isometry3d motion_of(const Vector6& twist) {
  return se3_retract(Eigen::Isometry3d::Identity(), twist);
}

inline Camera camera_of(int width, int height, const Eigen::Isometry3d& world_from_camera) {
  return camera_from_fov(width, height, 1.2, world_from_camera);
}

/// Rendering of a map by a camera.
template <typename T>
struct Picture {
  Picture(const BasicGaussianMap<T>& map, const Camera& at)
      : camera(at), images(raster::Rasterizer<T>().forward(map.view(), at)) {}

  RgbdView<T> view() const { return {camera, images.rgb.data(), images.depth.data(), nullptr}; }

  Camera camera;
  raster::Images<T> images;
};

inline Eigen::Isometry3d some_pose(Random& random) {
  Vector6 twist;
  for (int i = 0; i < 3; ++i) twist[i] = random.uniform(-0.3, 0.3);
  for (int i = 3; i < 6; ++i) twist[i] = random.uniform(-0.2, 0.2);
  return motion_of(twist);
}

/// Askew, so that no two tiles are equally near.
inline const Eigen::Isometry3d kAskew = [] {
  Vector6 twist;
  twist << 0.05, -0.1, 0.1, 0.07, -0.05, 0.03;
  return motion_of(twist);
}();

}  // namespace gslts::align::testing
