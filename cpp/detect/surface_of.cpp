#include "surface_of.hpp"

#include <array>
#include <cmath>

#include "color_histogram.hpp"

namespace gslts::detect {
namespace {

/// Maximum depth of the surface, m.
double max_depth_of(const float* depth, const Pixels& pixels) {
  std::vector<double> depths;
  for (const std::size_t k : pixels) {
    if (has_depth(depth[k])) depths.push_back(depth[k]);
  }
  return depths.empty() ? 0 : (1 + kMaxDepthSpread) * quantile(depths, 0.5);
}

void measure_colors(const Views& views, const Pixels& pixels, Surface& surface) {
  const float* rgb = surface.side == Side::kAfter ? views.observed_rgb : views.rendered_rgb;
  std::array<std::vector<double>, 3> channels;
  ColorHistogram histogram;
  for (const std::size_t k : pixels) {
    for (std::size_t c = 0; c < 3; ++c) channels[c].push_back(rgb[3 * k + c]);
    const float change = color_difference(views.observed_rgb + 3 * k, views.rendered_rgb + 3 * k);
    histogram.add(rgb + 3 * k, kMinPixelWeight + change);
  }
  for (int c = 0; c < 3; ++c) surface.color[c] = quantile(channels[std::size_t(c)], 0.5);
  surface.color_histogram = histogram.shares();
}

/// @return  false if there is no depth.
bool measure_shape(const Views& views, const Pixels& pixels, Surface& surface) {
  const bool after = surface.side == Side::kAfter;
  const float* depth = after ? views.observed_depth : views.rendered_depth;
  const float* other = after ? views.rendered_depth : views.observed_depth;
  const Camera& camera = views.camera;
  const std::size_t width = std::size_t(camera.width);
  const std::size_t stride = pixels.size() / kMaxSamples + 1;
  const double max_depth_m = max_depth_of(depth, pixels);
  std::array<std::vector<double>, 3> coordinates;
  std::vector<double> depths, steps;
  for (const std::size_t k : pixels) {
    const double z = depth[k];
    if (!has_depth(depth[k]) || z > max_depth_m) continue;
    const Eigen::Vector3d point =
        unproject(camera, double(k % width) + 0.5, double(k / width) + 0.5, z);
    if (depths.size() % stride == 0) surface.samples.push_back(point);
    for (int c = 0; c < 3; ++c) coordinates[std::size_t(c)].push_back(point[c]);
    depths.push_back(z);
    surface.area_m2 += z * z / (camera.fx * camera.fy);
    if (has_depth(other[k])) steps.push_back(double(other[k]) - z);
  }
  if (depths.empty()) return false;
  surface.depth_m = quantile(depths, 0.5);
  for (int c = 0; c < 3; ++c) {
    std::vector<double>& values = coordinates[std::size_t(c)];
    surface.low[c] = quantile(values, kTrimmedQuantile);
    surface.high[c] = quantile(values, 1 - kTrimmedQuantile);
    surface.point[c] = quantile(values, 0.5);
  }
  if (!steps.empty()) surface.step_m = quantile(steps, 0.5);
  return true;
}

}  // namespace

std::optional<Surface> surface_of(const Views& views, const Pixels& pixels, Side side) {
  Surface surface;
  surface.side = side;
  surface.area_px = int(pixels.size());
  if (!measure_shape(views, pixels, surface)) return std::nullopt;
  measure_colors(views, pixels, surface);
  return surface;
}

}  // namespace gslts::detect
