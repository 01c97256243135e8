#include "gslts/fusion/register_depth.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace gslts::fusion {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A relative step of the depth from pixel to pixel that ends a surface. At 640 px a plane seen at
/// 80 degrees from its normal makes steps of 0.02.
constexpr double kEdgeStep = 0.05;
/// Half the side of the patch of a pixel: more than 0.5, so that no cracks open between neighbours
/// on a bent or noisy surface.
constexpr double kHalfSide_px = 0.55;
/// Minimum depth of a patch in the other camera, m: nearer ones would fill the image.
constexpr double kNear_m = 0.05;
/// Minimum area of a patch in the other image, px^2: smaller ones are seen edge-on.
constexpr double kEdgeOn = 1e-6;

/// A pixel position and its inverse depth, 1/m, which is linear in the image of a plane.
struct ImagePoint {
  double u, v, inverse;
};

/// Homography of the pixels of one camera to those of another, by inverse depth.
class Reprojection {
 public:
  Reprojection(const Camera& from, const Camera& to) {
    const Eigen::Isometry3d to_from = to.world_from_camera.inverse() * from.world_from_camera;
    turn_ = intrinsics(to) * to_from.linear() * intrinsics(from).inverse();
    shift_ = intrinsics(to) * to_from.translation();
  }

  /// Homogeneous position of the pixel (x, y) at an inverse depth, over its depth in the first
  /// image.
  Vector3d project(double x, double y, double inverse) const {
    return turn_ * Vector3d(x, y, 1) + shift_ * inverse;
  }
  /// Change of `project` from one pixel to the next, where the inverse depth changes by `slope`.
  Vector3d across(double slope) const { return turn_.col(0) + slope * shift_; }
  Vector3d down(double slope) const { return turn_.col(1) + slope * shift_; }

 private:
  static Matrix3d intrinsics(const Camera& c) {
    Matrix3d matrix;
    matrix << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
    return matrix;
  }
  Matrix3d turn_;
  Vector3d shift_;
};

std::optional<ImagePoint> dehomogenize(const Vector3d& position, double inverse) {
  if (!(inverse > 0 && position.z() > kNear_m * inverse)) return std::nullopt;
  const double scale = 1 / position.z();
  return ImagePoint{position.x() * scale, position.y() * scale, inverse * scale};
}

/// Slope of the surface from pixel to pixel, in inverse depth, from the neighbours that belong to
/// it; `before` and `after` are 0 where nothing was measured.
double slope(double before, double here, double after) {
  const double max_step = kEdgeStep * here;
  const bool joins_before = std::abs(here - before) <= max_step;
  const bool joins_after = std::abs(after - here) <= max_step;
  const double total = (joins_before ? here - before : 0) + (joins_after ? after - here : 0);
  return joins_before && joins_after ? 0.5 * total : total;
}

/// The pixels [first, last) whose centres lie in (low, high], within an image of that length.
struct Span {
  int first, last;
};

Span centres_in(double low, double high, int length) {
  const auto after = [&](double edge) { return int(std::clamp(edge, 0.0, length - 0.5) + 0.5); };
  return {after(low), after(high)};
}

/// The planar patch of surface at a pixel, in the image of the other camera.
class Patch {
 public:
  /// Makes the patch of a pixel; nothing if a part of it is behind the camera, or too near.
  static std::optional<Patch> of(const Reprojection& reprojection, double x, double y,
                                 double inverse, double slope_x, double slope_y) {
    const Vector3d position = reprojection.project(x, y, inverse);
    const std::optional<ImagePoint> centre = dehomogenize(position, inverse);
    if (!centre) return std::nullopt;
    // Changes by one step across the patch and one down it, to first order.
    const double scale = 1 / position.z();
    const auto step = [&](const Vector3d& of_position, double of_inverse) -> Vector3d {
      return scale * (Vector3d(of_position.x(), of_position.y(), of_inverse) -
                      of_position.z() * Vector3d(centre->u, centre->v, centre->inverse));
    };
    const Patch patch(*centre, step(reprojection.across(slope_x), slope_x),
                      step(reprojection.down(slope_y), slope_y));
    if (patch.reach_.z() >= centre->inverse) return std::nullopt;
    return patch;
  }

  void draw(Array<float>& depth, int width, int height) const {
    const Span columns = centres_in(centre_.u - reach_.x(), centre_.u + reach_.x(), width);
    const Span rows = centres_in(centre_.v - reach_.y(), centre_.v + reach_.y(), height);
    for (int j = rows.first; j < rows.last; ++j) {
      for (int i = columns.first; i < columns.last; ++i) {
        const double step = per_u_ * (i + 0.5 - centre_.u) + per_v_ * (j + 0.5 - centre_.v);
        // The bounding box is larger than the patch, which may be steep there.
        if (std::abs(step) > reach_.z()) continue;
        float& there = depth[std::size_t(j) * width + i];
        const float nearer = float(1 / (centre_.inverse + step));
        if (there == 0 || nearer < there) there = nearer;
      }
    }
  }

 private:
  /// `across` and `down` change (u, v, inverse depth).
  Patch(const ImagePoint& centre, const Vector3d& across, const Vector3d& down)
      : centre_(centre), reach_(kHalfSide_px * (across.cwiseAbs() + down.cwiseAbs())) {
    const double area = across.x() * down.y() - across.y() * down.x();
    if (std::abs(area) < kEdgeOn) return;
    per_u_ = (across.z() * down.y() - down.z() * across.y()) / area;
    per_v_ = (down.z() * across.x() - across.z() * down.x()) / area;
  }

  ImagePoint centre_;
  Vector3d reach_;                ///< Half the sides of the box around it.
  double per_u_ = 0, per_v_ = 0;  ///< Slopes of the inverse depth in the image.
};

/// [H,W] 1/m, 0 where nothing was measured.
Array<double> inverse_depth(const float* depth, std::size_t size) {
  Array<double> inverse(size);
  std::transform(depth, depth + size, inverse.begin(),
                 [](float z) { return z > 0 && std::isfinite(z) ? 1 / double(z) : 0.0; });
  return inverse;
}

}  // namespace

Array<float> register_depth(const float* depth, const Camera& depth_camera, const Camera& camera) {
  validate(depth_camera, "register_depth");
  validate(camera, "register_depth");
  const Reprojection reprojection(depth_camera, camera);
  const int width = depth_camera.width, height = depth_camera.height;
  const Array<double> inverse = inverse_depth(depth, std::size_t(width) * height);
  Array<float> registered(std::size_t(camera.width) * camera.height);
  std::fill(registered.begin(), registered.end(), 0.0f);
  for (int y = 0; y < height; ++y) {
    const double* row = &inverse[std::size_t(y) * width];
    const double* above = y > 0 ? row - width : nullptr;
    const double* below = y + 1 < height ? row + width : nullptr;
    for (int x = 0; x < width; ++x) {
      if (row[x] == 0) continue;
      const double slope_x = slope(x > 0 ? row[x - 1] : 0, row[x], x + 1 < width ? row[x + 1] : 0);
      const double slope_y = slope(above ? above[x] : 0, row[x], below ? below[x] : 0);
      const auto patch = Patch::of(reprojection, x + 0.5, y + 0.5, row[x], slope_x, slope_y);
      if (patch) patch->draw(registered, camera.width, camera.height);
    }
  }
  return registered;
}

}  // namespace gslts::fusion
