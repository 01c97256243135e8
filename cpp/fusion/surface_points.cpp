#include "surface_points.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace gslts::fusion {
namespace {

/// A relative step of the depth between neighbours that ends a surface.
constexpr double kEdgeShare = 0.05;

/// Every n-th pixel of a depth image.
struct Samples {
  std::size_t rows, columns;
  Array<float> depth;  ///< [rows, columns] m; 0 means no measurement.

  double at(std::size_t row, std::size_t column) const {
    return double(depth[row * columns + column]);
  }
};

Samples sampled(const float* depth, const Camera& camera, const std::uint8_t* mask,
                std::size_t step) {
  Samples samples{(camera.height - 1) / step + 1, (camera.width - 1) / step + 1, {}};
  samples.depth.resize(samples.rows * samples.columns);
  float* out = samples.depth.data();
  for (std::size_t row = 0; row < samples.rows; ++row) {
    for (std::size_t column = 0; column < samples.columns; ++column) {
      const std::size_t pixel = row * step * camera.width + column * step;
      const bool measured = !std::isnan(depth[pixel]) && (!mask || mask[pixel]);
      const float z = measured ? depth[pixel] : 0.0f;
      if (z < 0 || z > std::numeric_limits<float>::max()) {
        std::ostringstream message;
        message << "SurfaceVoxels.add: depth must be finite and not negative, or NaN, got " << z
                << " in row " << row * step << ", column " << column * step;
        throw std::invalid_argument(message.str());
      }
      *out++ = z;
    }
  }
  return samples;
}

/// x/z or y/z of the centre of every `step`th pixel.
std::vector<double> slopes(std::size_t count, std::size_t step, double focal, double centre) {
  std::vector<double> result(count);
  for (std::size_t i = 0; i < count; ++i) result[i] = (double(i * step) + 0.5 - centre) / focal;
  return result;
}

}  // namespace

Array<SurfacePoint> surface_points(const float* depth, const std::uint8_t* rgb,
                                   const Camera& camera, const std::uint8_t* mask, int pixel_step) {
  const auto step = std::size_t(pixel_step);
  const Samples samples = sampled(depth, camera, mask, step);
  const std::vector<double> x = slopes(samples.columns, step, camera.fx, camera.cx);
  const std::vector<double> y = slopes(samples.rows, step, camera.fy, camera.cy);
  const auto in_camera = [&](std::size_t row, std::size_t column) -> Eigen::Vector3d {
    const double z = samples.at(row, column);
    return {x[column] * z, y[row] * z, z};
  };
  const auto rgb_at = [&](std::size_t row, std::size_t column) {
    return rgb + 3 * (row * step * camera.width + column * step);
  };
  const auto brightness = [&](std::size_t row, std::size_t column) {
    const std::uint8_t* c = rgb_at(row, column);
    return double(c[0] + c[1] + c[2]) / (3 * 255);
  };

  const Eigen::Matrix3d rotation = camera.world_from_camera.linear();
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  Array<SurfacePoint> points;
  for (std::size_t row = 1; row + 1 < samples.rows; ++row) {
    for (std::size_t column = 1; column + 1 < samples.columns; ++column) {
      const double z = samples.at(row, column);
      const auto continues = [&](std::size_t r, std::size_t c) {
        const double near = samples.at(r, c);
        return near > 0 && std::abs(near - z) < kEdgeShare * z;
      };
      if (!(z > 0 && continues(row - 1, column) && continues(row + 1, column) &&
            continues(row, column - 1) && continues(row, column + 1))) {
        continue;
      }
      const Eigen::Vector3d right = in_camera(row, column + 1) - in_camera(row, column - 1);
      const Eigen::Vector3d down = in_camera(row + 1, column) - in_camera(row - 1, column);
      const Eigen::Vector3d normal = down.cross(right);
      const double length = normal.norm();
      if (!(length > 0)) continue;
      const double per_pixel = 1.0 / (2 * pixel_step);
      const double across = brightness(row, column + 1) - brightness(row, column - 1);
      const double along = brightness(row + 1, column) - brightness(row - 1, column);
      const double per_m = per_pixel * camera.fx / z;
      const std::uint8_t* color = rgb_at(row, column);
      points.push_back({rotation * in_camera(row, column) + eye, rotation * (normal / length),
                        Eigen::Vector3d(color[0], color[1], color[2]) / 255.0,
                        (across * across + along * along) * (per_m * per_m)});
    }
  }
  return points;
}

}  // namespace gslts::fusion
