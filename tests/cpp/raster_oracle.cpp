#include "raster_oracle.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace gslts::raster::testing {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kMaxAlpha = 0.99;
constexpr double kMinQuatNorm = 1e-12;
constexpr double kJacobianMargin = 0.3;
constexpr double kMostSlant = 0.5;

/// A Gaussian in front of the camera, as the image sees it.
struct Splat {
  std::size_t row;
  Vector2d mean_px;
  Matrix2d inverse_cov2d;  // 1/px^2
  double opacity;
  Vector3d color;
  double depth_m;        // Of the centre.
  Vector2d depth_slope;  // m/px
};

/// The real spherical harmonics of 3DGS (Kerbl et al. 2023) in the unit direction d.
std::vector<double> sh_basis(int degree, const Vector3d& d) {
  const double x = d.x(), y = d.y(), z = d.z();
  std::vector<double> basis = {0.28209479177387814};
  if (degree >= 1) {
    const double c = 0.4886025119029199;
    basis.insert(basis.end(), {-c * y, c * z, -c * x});
  }
  if (degree >= 2) {
    basis.insert(basis.end(), {1.0925484305920792 * x * y,                         //
                               -1.0925484305920792 * y * z,                        //
                               0.31539156525252005 * (2 * z * z - x * x - y * y),  //
                               -1.0925484305920792 * x * z,                        //
                               0.5462742152960396 * (x * x - y * y)});
  }
  if (degree >= 3) {
    basis.insert(basis.end(), {-0.5900435899266435 * y * (3 * x * x - y * y),                 //
                               2.890611442640554 * x * y * z,                                 //
                               -0.4570457994644658 * y * (4 * z * z - x * x - y * y),         //
                               0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),  //
                               -0.4570457994644658 * x * (4 * z * z - x * x - y * y),         //
                               1.445305721320277 * z * (x * x - y * y),                       //
                               -0.5900435899266435 * x * (x * x - 3 * y * y)});
  }
  return basis;
}

Matrix3d rotation_of(const double* wxyz) {
  Eigen::Vector4d quat(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double norm = quat.stableNorm();
  if (norm < kMinQuatNorm) return Matrix3d::Identity();
  quat /= norm;
  return Eigen::Quaterniond(quat[0], quat[1], quat[2], quat[3]).toRotationMatrix();
}

/// Derivative of the projection at a point of the camera frame, clamped to a little more than the
/// field of view, beyond which the affine approximation would break down.
Eigen::Matrix<double, 2, 3> projection_jacobian(const Vector3d& p, const Camera& camera) {
  const double margin_x = kJacobianMargin * camera.width / (2 * camera.fx);
  const double margin_y = kJacobianMargin * camera.height / (2 * camera.fy);
  const double tan_x = std::clamp(p.x() / p.z(), -camera.cx / camera.fx - margin_x,
                                  (camera.width - camera.cx) / camera.fx + margin_x);
  const double tan_y = std::clamp(p.y() / p.z(), -camera.cy / camera.fy - margin_y,
                                  (camera.height - camera.cy) / camera.fy + margin_y);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << camera.fx, 0, -camera.fx * tan_x,  //
      0, camera.fy, -camera.fy * tan_y;
  return jacobian / p.z();
}

Vector3d color_of(const BasicGaussianMap<double>& map, std::size_t row, int degree,
                  const Vector3d& direction) {
  const std::vector<double> basis = sh_basis(degree, direction);
  Vector3d color = Vector3d::Constant(0.5);
  for (std::size_t k = 0; k < basis.size(); ++k) {
    color += basis[k] * Vector3d::Map(&map.sh[(row * std::size_t(map.sh_bases) + k) * 3]);
  }
  return color;
}

/// The Gaussians in front of the near plane, from front to back.
std::vector<Splat> project(const BasicGaussianMap<double>& map, const Camera& camera,
                           const RenderOptions& options, const std::vector<Vector2d>& offsets_px) {
  const Matrix3d camera_from_world = camera.world_from_camera.linear().transpose();
  // Both far from the world's origin: subtract them before anything small is added.
  const Vector3d camera_in_map = camera.world_from_camera.translation() - map.origin;
  const int map_degree = int(std::lround(std::sqrt(map.sh_bases))) - 1;
  const int degree = std::min(options.sh_degree, map_degree);
  std::vector<Splat> splats;
  for (std::size_t row = 0; row < map.size(); ++row) {
    const Vector3d ray = Vector3d::Map(&map.means[3 * row]) - camera_in_map;
    const Vector3d p = camera_from_world * ray;
    if (p.z() <= options.near_m || p.z() > options.far_m) continue;

    const Vector3d scale = Vector3d::Map(&map.log_scales[3 * row]).array().exp();
    const Matrix3d axes = camera_from_world * rotation_of(&map.quats[4 * row]) * scale.asDiagonal();
    if (p.z() <= options.near_sigmas * axes.row(2).norm()) continue;
    // Columns are the Gaussian's axes as seen in the image: the covariance is U U^T.
    const Eigen::Matrix<double, 2, 3> u = projection_jacobian(p, camera) * axes;
    const Matrix2d cov2d = u * u.transpose() + options.eps2d_px2 * Matrix2d::Identity();
    // det(U U^T), without the cancellation of a thin matrix' determinant.
    const double det = u.row(0).cross(u.row(1)).squaredNorm();
    const double filtered_det =
        det + options.eps2d_px2 * u.squaredNorm() + options.eps2d_px2 * options.eps2d_px2;
    double opacity = 1 / (1 + std::exp(-map.logit_opacities[row]));
    if (options.antialias) opacity *= std::sqrt(det / filtered_det);

    Splat splat;
    splat.row = row;
    splat.mean_px = {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
    if (!offsets_px.empty()) splat.mean_px += offsets_px[row];
    splat.inverse_cov2d << cov2d(1, 1), -cov2d(0, 1), -cov2d(1, 0), cov2d(0, 0);
    splat.inverse_cov2d /= filtered_det;
    splat.opacity = opacity;
    splat.color = color_of(map, row, degree, ray.normalized());
    if (options.clamp_colors) splat.color = splat.color.cwiseMax(0.0);
    splat.depth_m = p.z();
    splat.depth_slope = Vector2d::Zero();
    if (options.surface_depth) {
      const Vector3d depth_axes = (camera_from_world * rotation_of(&map.quats[4 * row]))
                                      .row(2)
                                      .transpose()
                                      .cwiseProduct(scale);
      const Vector2d slope = splat.inverse_cov2d * (u * depth_axes);
      // The depth at the farthest end of the footprint, whose Mahalanobis distance is known.
      const double most = std::sqrt(slope.dot(cov2d * slope) * -2 * std::log(options.alpha_min));
      if (most < kMostSlant * p.z()) splat.depth_slope = slope;
    }
    splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const Splat& a, const Splat& b) { return a.depth_m < b.depth_m; });
  return splats;
}

double relative_distance(double value, double threshold) {
  return threshold > 0 ? std::abs(value / threshold - 1) : kInf;
}

void blend_pixel(const BasicGaussianMap<double>& map, const std::vector<Splat>& splats,
                 const RenderOptions& options, int x, int y, OracleRender& render) {
  Images<double>& images = render.images;
  const std::size_t pixel = std::size_t(y) * std::size_t(images.width) + std::size_t(x);
  const std::size_t dims = std::size_t(map.feature_dims);
  double transmittance = 1, weight_sum = 0, depth_sum = 0, last_depth_m = -kInf;
  Vector3d rgb = Vector3d::Zero();
  for (const Splat& splat : splats) {
    const Vector2d d = Vector2d(x + 0.5, y + 0.5) - splat.mean_px;
    const double unclamped = splat.opacity * std::exp(-0.5 * d.dot(splat.inverse_cov2d * d));
    render.alpha_margin[pixel] =
        std::min(render.alpha_margin[pixel], relative_distance(unclamped, options.alpha_min));
    if (!(unclamped >= options.alpha_min)) continue;

    const double alpha = std::min(kMaxAlpha, unclamped);
    const double after = transmittance * (1 - alpha);
    render.transmittance_margin[pixel] = std::min(
        render.transmittance_margin[pixel], relative_distance(after, options.transmittance_min));
    if (splat.depth_m > last_depth_m) {
      render.depth_margin[pixel] =
          std::min(render.depth_margin[pixel], (splat.depth_m - last_depth_m) / splat.depth_m);
    }
    last_depth_m = splat.depth_m;
    if (after < options.transmittance_min) break;

    const double weight = alpha * transmittance;
    transmittance = after;
    weight_sum += weight;
    depth_sum += weight * (splat.depth_m + splat.depth_slope.dot(d));
    rgb += weight * splat.color;
    for (std::size_t k = 0; k < dims; ++k) {
      images.features[pixel * dims + k] += weight * map.features[splat.row * dims + k];
    }
    render.max_weights[splat.row] = std::max(render.max_weights[splat.row], weight);
    ++render.pixel_counts[splat.row];
  }
  for (std::size_t c = 0; c < 3; ++c) {
    images.rgb[3 * pixel + c] = rgb[Eigen::Index(c)] + (1 - weight_sum) * options.background[c];
  }
  images.depth[pixel] = weight_sum > 0 ? depth_sum / weight_sum : 0;
  images.alpha[pixel] = weight_sum;
}

}  // namespace

OracleRender render_oracle(const BasicGaussianMap<double>& map, const Camera& camera,
                           const RenderOptions& options, const PixelMask& mask,
                           const std::vector<Vector2d>& mean2d_offsets_px) {
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  OracleRender render;
  render.images.width = camera.width;
  render.images.height = camera.height;
  render.images.feature_dims = map.feature_dims;
  render.images.rgb.assign(3 * pixels, 0.0);
  render.images.depth.assign(pixels, 0.0);
  render.images.alpha.assign(pixels, 0.0);
  render.images.features.assign(pixels * std::size_t(map.feature_dims), 0.0);
  render.alpha_margin.assign(pixels, kInf);
  render.transmittance_margin.assign(pixels, kInf);
  render.depth_margin.assign(pixels, kInf);
  render.max_weights.assign(map.size(), 0.0);
  render.pixel_counts.assign(map.size(), 0);

  const std::vector<Splat> splats = project(map, camera, options, mean2d_offsets_px);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const std::size_t pixel = std::size_t(y) * std::size_t(camera.width) + std::size_t(x);
      if (mask.data && !mask.data[pixel]) continue;
      blend_pixel(map, splats, options, x, y, render);
    }
  }
  return render;
}

}  // namespace gslts::raster::testing
