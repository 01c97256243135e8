#include "surface_of.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "color_histogram.hpp"

namespace gslts::detect {
namespace {

/// Share of the points at either end of an axis that may be strays.
constexpr double kStrays = 0.05;

/// Enough to tell which part of a surface is where.
constexpr std::size_t kSamples = 100;

double at_share(std::vector<double>& values, double share) {
  const auto middle = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// At the edge of a surface colours are mixed with what is around it, which both images show: what
/// differs tells more of it.
constexpr float kLeastColor = 0.05f;

float difference(const float* one, const float* other) {
  return std::abs(one[0] - other[0]) + std::abs(one[1] - other[1]) + std::abs(one[2] - other[2]);
}

bool measured(float depth) { return depth > 0 && std::isfinite(depth); }

/// At the outline of a surface some pixels show what is behind it.
double farthest_of(const float* depth, const Pixels& pixels) {
  constexpr double kDeepest = 0.25;  // Of the depth.
  std::vector<double> depths;
  for (const std::size_t k : pixels) {
    if (measured(depth[k])) depths.push_back(depth[k]);
  }
  return depths.empty() ? 0 : (1 + kDeepest) * at_share(depths, 0.5);
}

}  // namespace

std::optional<Surface> surface_of(const Views& views, const Pixels& pixels, Side side) {
  const bool after = side == Side::kAfter;
  const float* depth = after ? views.measured : views.rendered;
  const float* other = after ? views.rendered : views.measured;
  const float* colors = after ? views.photo : views.rgb;
  const Camera& camera = views.camera;
  std::array<std::vector<double>, 3> points, channels;
  std::vector<double> depths, steps;
  ColorHistogram histogram;
  Surface surface;
  surface.side = side;
  const std::size_t stride = pixels.size() / kSamples + 1;
  const double farthest_m = farthest_of(depth, pixels);
  for (const std::size_t k : pixels) {
    for (std::size_t c = 0; c < 3; ++c) channels[c].push_back(colors[3 * k + c]);
    histogram.add(colors + 3 * k, kLeastColor + difference(views.photo + 3 * k, views.rgb + 3 * k));
    const double z = depth[k];
    if (!measured(depth[k]) || z > farthest_m) continue;
    const double x = (double(k % std::size_t(camera.width)) + 0.5 - camera.cx) / camera.fx * z;
    const double y = (double(k / std::size_t(camera.width)) + 0.5 - camera.cy) / camera.fy * z;
    const Eigen::Vector3d point = camera.world_from_camera * Eigen::Vector3d(x, y, z);
    if (points[0].size() % stride == 0) surface.samples.push_back(point);
    for (int c = 0; c < 3; ++c) points[std::size_t(c)].push_back(point[c]);
    depths.push_back(z);
    surface.area_m2 += z * z / (camera.fx * camera.fy);
    if (measured(other[k])) steps.push_back(double(other[k]) - z);
  }
  if (points[0].empty()) return std::nullopt;
  surface.area_px = int(pixels.size());
  surface.depth_m = at_share(depths, 0.5);
  surface.colors = histogram.smoothed();
  for (int c = 0; c < 3; ++c) {
    std::vector<double>& values = points[std::size_t(c)];
    surface.low[c] = at_share(values, kStrays);
    surface.high[c] = at_share(values, 1 - kStrays);
    surface.point[c] = at_share(values, 0.5);
    surface.color[c] = at_share(channels[std::size_t(c)], 0.5);
  }
  if (!steps.empty()) surface.step_m = at_share(steps, 0.5);
  return surface;
}

}  // namespace gslts::detect
