#include "gslts/raster/chunks_in_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "chunks_in_view.hpp"

namespace gslts::raster {
namespace {

/// Share of the sizes of the terms of a plane by which its distances may err in the float
/// arithmetic of `cull_chunk`; about 100 roundings.
constexpr double kPlaneRounding = 1e-5;

/// Half space normal . x_in_map + offset + reach exp(log_scale) > 0 in which a Gaussian is in view.
struct Plane {
  double normal[3], offset, reach;

  /// Tests whether any Gaussian within the bounds can be in the half space.
  bool meets(const ChunkBounds::Box& box) const {
    double most = offset, sizes = std::abs(offset);
    for (int i = 0; i < 3; ++i) {
      const double low = normal[i] * box.low[i], high = normal[i] * box.high[i];
      most += std::max(low, high);
      sizes += std::max(std::abs(low), std::abs(high));
    }
    most += reach * std::exp(std::min(box.max_log_scale, kMaxLogScale));
    return most + kPlaneRounding * sizes > 0;
  }
};

/// Makes the plane x_in_camera . normal + offset > 0 in the frame of the map.
template <typename T>
Plane plane_in_map(const RenderSetup<T>& setup, const std::array<double, 3>& normal, double offset,
                   double reach) {
  Plane plane = {{0, 0, 0}, offset, reach};
  for (int i = 0; i < 3; ++i) {
    plane.offset += normal[i] * double(setup.map_origin_in_camera[i]);
    for (int j = 0; j < 3; ++j) plane.normal[j] += normal[i] * double(setup.camera_from_map[i][j]);
  }
  return plane;
}

/// Computes the six planes of the view: `BoundingCircle::meets`, times the depth z > 0. With the
/// radius r = a s / z + b of a Gaussian of the standard deviation s, x + r > x0 for its centre
/// x = fx X / z + cx becomes fx X + (cx - x0 + b) z + a s > 0, and so on.
template <typename T>
std::array<Plane, 6> view_planes(const RenderSetup<T>& setup) {
  // A little beyond the circles of `BoundingCircle`, whose radii have 1.01 here, for their
  // rounding.
  const double extent = 1.02 * std::sqrt(-2 * kLn2 * double(setup.log2_alpha_min));
  const auto largest = [](T low, T high) {
    return double(std::max(std::abs(low), std::abs(high)));
  };
  const double secant = std::hypot(1.0, largest(setup.min_tan_x, setup.max_tan_x),
                                   largest(setup.min_tan_y, setup.max_tan_y));
  const double fx = setup.fx, fy = setup.fy, cx = setup.cx, cy = setup.cy;
  const double a = extent * secant * std::max(fx, fy);
  const double b = 1.02 + extent * std::sqrt(double(setup.eps2d_px2));
  return {plane_in_map(setup, {0, 0, 1}, -double(setup.near_m), 0),
          plane_in_map(setup, {0, 0, -1}, double(setup.far_m), 0),
          plane_in_map(setup, {fx, 0, cx - setup.region.x0 + b}, 0, a),
          plane_in_map(setup, {-fx, 0, setup.region.x1 - cx + b}, 0, a),
          plane_in_map(setup, {0, fy, cy - setup.region.y0 + b}, 0, a),
          plane_in_map(setup, {0, -fy, setup.region.y1 - cy + b}, 0, a)};
}

}  // namespace

template <typename T>
std::vector<std::uint32_t> chunks_in_view(const GaussianView<T>& gaussians,
                                          const RenderSetup<T>& setup) {
  std::vector<std::uint32_t> chunks((gaussians.size + kChunkSize - 1) / kChunkSize);
  std::iota(chunks.begin(), chunks.end(), 0u);
  if (!gaussians.bounds) return chunks;
  const std::array<Plane, 6> planes = view_planes(setup);
  const auto out_of_view = [&](std::uint32_t chunk) {
    const ChunkBounds::Box& box = gaussians.bounds->chunks[chunk];
    return !std::all_of(planes.begin(), planes.end(),
                        [&](const Plane& plane) { return plane.meets(box); });
  };
  chunks.erase(std::remove_if(chunks.begin(), chunks.end(), out_of_view), chunks.end());
  return chunks;
}

template <typename T>
std::vector<std::uint32_t> chunks_in_view(const GaussianView<T>& gaussians, const Camera& camera,
                                          const RenderOptions& options) {
  gslts::validate(gaussians, "chunks_in_view");
  return chunks_in_view(gaussians, make_setup(gaussians, camera, options));
}

template std::vector<std::uint32_t> chunks_in_view(const GaussianView<float>&, const Camera&,
                                                   const RenderOptions&);
template std::vector<std::uint32_t> chunks_in_view(const GaussianView<double>&, const Camera&,
                                                   const RenderOptions&);
template std::vector<std::uint32_t> chunks_in_view(const GaussianView<float>&,
                                                   const RenderSetup<float>&);
template std::vector<std::uint32_t> chunks_in_view(const GaussianView<double>&,
                                                   const RenderSetup<double>&);

}  // namespace gslts::raster
