#pragma once

#include <string>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::benchmarks {

/// A scene and a camera; see workloads.py, which generates them, for the file.
template <typename T>
struct Workload {
  BasicGaussianMap<T> map;
  Camera camera;
  double near_m;

  raster::RenderOptions options(int threads) const;
  std::size_t pixels() const { return std::size_t(camera.width) * std::size_t(camera.height); }
};

/// Reads workload `name` (S, M or L) with SH degree 0 or 3.
/// @throws std::runtime_error  with the path, if it cannot be read.
template <typename T>
Workload<T> read_workload(const std::string& folder, const std::string& name, int sh_degree);

/// A fixed random gradient of every image, so that no part of the backward pass is left out.
template <typename T>
struct RandomImageGradients {
  Array<T> rgb, depth, alpha;
  explicit RandomImageGradients(std::size_t pixels);
  raster::ImageGradients<T> view() const { return {rgb.data(), depth.data(), alpha.data()}; }
};

/// Share of the pixels in the benchmarks of a region.
constexpr double kRegionShare = 0.1;

/// Columns [x0, x1) and rows [y0, y1) of an image.
struct Region {
  int x0, y0, x1, y1;
};

/// The central rectangle that holds the given share of the pixels.
Region central_region(int width, int height, double share);

/// A mask [H,W] of the central rectangle that holds the given share of the pixels.
std::vector<std::uint8_t> central_mask(int width, int height, double share);

}  // namespace gslts::benchmarks
