#include "surface_points.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <optional>
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

Samples sample(const float* depth, const Camera& camera, const std::uint8_t* mask,
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

/// Points of the samples of a depth image.
class Unprojection {
 public:
  Unprojection(const float* depth, const std::uint8_t* rgb, const Camera& camera,
               const std::uint8_t* mask, int pixel_step)
      : rgb_(rgb),
        camera_(camera),
        step_(std::size_t(pixel_step)),
        samples_(sample(depth, camera, mask, step_)),
        x_(slopes(samples_.columns, step_, camera.fx, camera.cx)),
        y_(slopes(samples_.rows, step_, camera.fy, camera.cy)),
        rotation_(camera.world_from_camera.linear()) {}

  std::size_t rows() const { return samples_.rows; }
  std::size_t columns() const { return samples_.columns; }

  /// The point of a sample; nothing where it or a neighbour is not measured, or the surface ends.
  /// @param row, column  Of an inner sample.
  std::optional<SurfacePoint> point(std::size_t row, std::size_t column) const {
    const double z = samples_.at(row, column);
    if (!(z > 0 && continues(z, row - 1, column) && continues(z, row + 1, column) &&
          continues(z, row, column - 1) && continues(z, row, column + 1))) {
      return std::nullopt;
    }
    const Eigen::Vector3d right = in_camera(row, column + 1) - in_camera(row, column - 1);
    const Eigen::Vector3d down = in_camera(row + 1, column) - in_camera(row - 1, column);
    const Eigen::Vector3d normal = down.cross(right);
    const double length = normal.norm();
    if (!(length > 0)) return std::nullopt;
    const double per_pixel = 1.0 / (2 * int(step_));
    const double across = brightness(row, column + 1) - brightness(row, column - 1);
    const double along = (brightness(row + 1, column) - brightness(row - 1, column)) *
                         (camera_.fy / camera_.fx);  // As if pixels were square.
    const double per_m = per_pixel * camera_.fx / z;
    const std::uint8_t* color = rgb_at(row, column);
    return SurfacePoint{
        rotation_ * in_camera(row, column) + camera_.world_from_camera.translation(),
        rotation_ * (normal / length), Eigen::Vector3d(color[0], color[1], color[2]) / 255.0,
        (across * across + along * along) * (per_m * per_m)};
  }

 private:
  Eigen::Vector3d in_camera(std::size_t row, std::size_t column) const {
    const double z = samples_.at(row, column);
    return {x_[column] * z, y_[row] * z, z};
  }

  const std::uint8_t* rgb_at(std::size_t row, std::size_t column) const {
    return rgb_ + 3 * (row * step_ * camera_.width + column * step_);
  }

  double brightness(std::size_t row, std::size_t column) const {
    const std::uint8_t* c = rgb_at(row, column);
    return double(c[0] + c[1] + c[2]) / (3 * 255);
  }

  bool continues(double z, std::size_t row, std::size_t column) const {
    const double near = samples_.at(row, column);
    return near > 0 && std::abs(near - z) < kEdgeShare * z;
  }

  const std::uint8_t* rgb_;
  const Camera& camera_;
  std::size_t step_;
  Samples samples_;
  std::vector<double> x_, y_;  ///< x/z and y/z of the columns and rows.
  Eigen::Matrix3d rotation_;
};

}  // namespace

Array<SurfacePoint> surface_points(const float* depth, const std::uint8_t* rgb,
                                   const Camera& camera, const std::uint8_t* mask, int pixel_step) {
  const Unprojection image(depth, rgb, camera, mask, pixel_step);
  Array<SurfacePoint> points;
  for (std::size_t row = 1; row + 1 < image.rows(); ++row) {
    for (std::size_t column = 1; column + 1 < image.columns(); ++column) {
      const std::optional<SurfacePoint> point = image.point(row, column);
      if (point) points.push_back(*point);
    }
  }
  return points;
}

}  // namespace gslts::fusion
