#include "gslts/sim/visible_triangles.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"
#include "gslts/sim/triangle_hits.hpp"

namespace gslts::sim {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Triangles and rows of pixels that a thread takes at a time.
constexpr std::size_t kChunk = 1024, kBand = 16;
/// Depth at which triangles are cut to find the part of the image that they cover, m.
constexpr double kNearM = 1e-6;
/// Rectangles around triangles are wider by this, so that rounding cuts off no pixel centre, px.
constexpr double kMarginPx = 1e-3;
/// A triangle whose plane passes the eye at a smaller angle, rad, is thinner than any pixel.
constexpr double kEdgeOnRad = 1e-9;
/// Ratio of inverse depths at which a later triangle is nearer. Surfaces that coincide but for the
/// rounding of their corners, 2e-7 for float, show the first and no speckle of both.
constexpr double kNearer = 1 + 1e-6;

/// The part of a triangle that may be seen, and linear functions a x + b y + c of column and row.
struct Visible {
  Vector3d edges[3];        ///< Not negative inside the triangle.
  Vector3d inverse_depth;   ///< 1/m
  int columns[2], rows[2];  ///< First and last.
  std::uint32_t index;
};

class Projection {
 public:
  explicit Projection(const Camera& camera)
      : camera_(camera),
        camera_from_world_(camera.world_from_camera.linear().inverse()),
        eye_(camera.world_from_camera.translation().cast<float>().cast<double>()) {}

  /// Tells if a triangle may cover pixel centres, and how.
  bool project(const float* corners, Visible& result) const {
    Vector3d points[3];
    for (int k = 0; k < 3; ++k) {
      const Vector3d in_world(corners[3 * k], corners[3 * k + 1], corners[3 * k + 2]);
      points[k] = camera_from_world_ * (in_world - eye_);
    }
    if (!find_pixels(points, result)) return false;
    const Vector3d normal = (points[1] - points[0]).cross(points[2] - points[0]);
    const double volume = normal.dot(points[0]);
    if (!(std::abs(volume) > kEdgeOnRad * normal.norm() * points[0].norm())) return false;
    result.inverse_depth = on_image(normal / volume);
    for (int k = 0; k < 3; ++k) {
      // Exactly the negative for a neighbour that shares the edge: no pixel falls between.
      const Vector3d edge = on_image(points[k].cross(points[(k + 1) % 3]));
      result.edges[k] = volume > 0 ? edge : Vector3d(-edge);
    }
    return true;
  }

 private:
  /// A plane through the eye, as a function of column and row.
  Vector3d on_image(const Vector3d& normal) const {
    const double a = normal.x() / camera_.fx, b = normal.y() / camera_.fy;
    return {a, b, normal.z() + a * (0.5 - camera_.cx) + b * (0.5 - camera_.cy)};
  }

  /// Finds the pixel centres in the rectangle around the part in front of the camera, if any.
  bool find_pixels(const Vector3d* points, Visible& result) const {
    AlignedBox2d box;
    const auto add = [&](double x, double y, double z) {
      box.extend(Vector2d(camera_.fx * x / z + camera_.cx, camera_.fy * y / z + camera_.cy));
    };
    for (int k = 0; k < 3; ++k) {
      const Vector3d &from = points[k], &to = points[(k + 1) % 3];
      if (from.z() >= kNearM) add(from.x(), from.y(), from.z());
      if ((from.z() >= kNearM) == (to.z() >= kNearM)) continue;
      const Vector3d cut = from + (kNearM - from.z()) / (to.z() - from.z()) * (to - from);
      add(cut.x(), cut.y(), kNearM);
    }
    if (box.isEmpty()) return false;
    const Vector2d last(camera_.width - 1, camera_.height - 1);
    const Vector2d low = (box.min().array() - 0.5 - kMarginPx).ceil().max(0.0);
    const Vector2d high = (box.max().array() - 0.5 + kMarginPx).floor().min(last.array());
    if (!(low.array() <= high.array()).all()) return false;
    for (int k = 0; k < 2; ++k) {
      result.columns[k] = int((k == 0 ? low : high).x());
      result.rows[k] = int((k == 0 ? low : high).y());
    }
    return true;
  }

  Camera camera_;
  Matrix3d camera_from_world_;
  Vector3d eye_;
};

/// Draws the row of a triangle where it is nearer than what is there.
void draw_row(const Visible& triangle, int row, double* inverse_depths, std::uint32_t* indices) {
  double first = triangle.columns[0], last = triangle.columns[1];
  for (const Vector3d& edge : triangle.edges) {
    const double rest = edge[1] * row + edge[2];
    if (edge[0] > 0) {
      first = std::max(first, std::ceil(-rest / edge[0]));
    } else if (edge[0] < 0) {
      last = std::min(last, std::floor(-rest / edge[0]));
    } else if (rest < 0) {
      return;
    }
  }
  if (first > last) return;
  const double slope = triangle.inverse_depth[0];
  const double rest = triangle.inverse_depth[1] * row + triangle.inverse_depth[2];
  for (int column = int(first); column <= int(last); ++column) {
    const double inverse_depth = slope * column + rest;
    if (inverse_depth > kNearer * inverse_depths[column]) {
      inverse_depths[column] = inverse_depth;
      indices[column] = triangle.index;
    }
  }
}

}  // namespace

Array<std::uint32_t> visible_triangles(const Camera& camera, const float* corners,
                                       std::size_t count, int threads) {
  validate(camera, "visible_triangles");
  const Projection projection(camera);
  std::vector<std::vector<Visible>> chunks((count + kChunk - 1) / kChunk);
  parallel::parallel_for(chunks.size(), threads, [&](std::size_t chunk) {
    const std::size_t end = std::min(count, (chunk + 1) * kChunk);
    Visible visible;
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      visible.index = std::uint32_t(i);
      if (projection.project(corners + 9 * i, visible)) chunks[chunk].push_back(visible);
    }
  });
  const auto width = std::size_t(camera.width), height = std::size_t(camera.height);
  Array<std::uint32_t> result(width * height);
  parallel::parallel_for((height + kBand - 1) / kBand, threads, [&](std::size_t band) {
    const std::size_t begin = band * kBand, end = std::min(height, begin + kBand);
    std::fill(result.begin() + long(begin * width), result.begin() + long(end * width),
              kNoTriangle);
    std::vector<double> inverse_depths(kBand * width, 0.0);
    for (const std::vector<Visible>& chunk : chunks) {
      for (const Visible& triangle : chunk) {
        const int first = std::max(triangle.rows[0], int(begin));
        const int last = std::min(triangle.rows[1], int(end) - 1);
        for (int row = first; row <= last; ++row) {
          draw_row(triangle, row, inverse_depths.data() + (std::size_t(row) - begin) * width,
                   result.data() + std::size_t(row) * width);
        }
      }
    }
  });
  return result;
}

}  // namespace gslts::sim
