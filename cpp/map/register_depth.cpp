#include "gslts/map/register_depth.hpp"

#include <algorithm>
#include <cmath>

namespace gslts {
namespace {

/// Squares of neighbours on a slanted surface leave cracks between them; so much wider, in px of
/// the other image, they close.
constexpr double kMargin_px = 0.1;
/// Nearer than this the projection of a square would fill the image.
constexpr double kNear_m = 0.05;

/// The pixels whose centres lie in [low, high), within an image of that length.
struct Span {
  int first, last;
};

Span centres_in(double low, double high, int length) {
  const auto clamped = [&](double edge) {
    return int(std::ceil(std::clamp(edge, -1.0, length + 1.0) - 0.5));
  };
  return {std::max(0, clamped(low)), std::min(length, clamped(high))};
}

}  // namespace

Array<float> register_depth(const float* depth, const Camera& depth_camera, const Camera& camera) {
  validate(depth_camera, "register_depth");
  validate(camera, "register_depth");
  const Eigen::Isometry3d camera_from_depth =
      camera.world_from_camera.inverse() * depth_camera.world_from_camera;
  Array<float> registered(std::size_t(camera.width) * camera.height);
  std::fill(registered.begin(), registered.end(), 0.0f);
  for (int y = 0; y < depth_camera.height; ++y) {
    for (int x = 0; x < depth_camera.width; ++x) {
      const double z = double(depth[std::size_t(y) * depth_camera.width + x]);
      if (!(z > 0) || !std::isfinite(z)) continue;
      const Eigen::Vector3d point =
          camera_from_depth * Eigen::Vector3d((x + 0.5 - depth_camera.cx) / depth_camera.fx * z,
                                              (y + 0.5 - depth_camera.cy) / depth_camera.fy * z, z);
      if (point.z() < kNear_m) continue;
      const double u = camera.fx * point.x() / point.z() + camera.cx;
      const double v = camera.fy * point.y() / point.z() + camera.cy;
      // Half the side of the square, as the other camera sees it.
      const double scale = 0.5 * z / point.z();
      const double half_u = scale * camera.fx / depth_camera.fx + kMargin_px;
      const double half_v = scale * camera.fy / depth_camera.fy + kMargin_px;
      const Span columns = centres_in(u - half_u, u + half_u, camera.width);
      const Span rows = centres_in(v - half_v, v + half_v, camera.height);
      const float nearer = float(point.z());
      for (int j = rows.first; j < rows.last; ++j) {
        for (int i = columns.first; i < columns.last; ++i) {
          float& there = registered[std::size_t(j) * camera.width + i];
          if (there == 0 || nearer < there) there = nearer;
        }
      }
    }
  }
  return registered;
}

}  // namespace gslts
