#include "gslts/align/view_cost.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/optim/losses.hpp"
#include "gslts/parallel/parallel_for.hpp"

namespace gslts::align {
namespace {

constexpr int kRowsPerTask = 8;
/// Differences of colours beyond which a pixel shows something else, and tells no exposure.
constexpr double kOtherThing = 0.25;
/// A relative step of the depth between neighbours that ends a surface.
constexpr double kDepthEdge = 0.05;
/// Of the pixels, for the curvature, which is smooth: each in so many columns and rows.
constexpr int kCurvatureStep = 2;

/// rho(s) = s / (1 + s) / 2 and twice its derivative, the weight of a squared residual.
template <typename T>
T rho(T s) {
  return s / (1 + s) / 2;
}

template <typename T>
T weight(T s) {
  return 1 / ((1 + s) * (1 + s));
}

void require(bool holds, const char* what, double value) {
  if (holds) return;
  throw std::invalid_argument(std::string("ViewCost: ") + what + ", got " + std::to_string(value));
}

void validate(const CostRule& rule) {
  require(rule.color_scale > 0 && std::isfinite(rule.color_scale), "color_scale must be positive",
          rule.color_scale);
  require(rule.depth_scale > 0 && std::isfinite(rule.depth_scale), "depth_scale must be positive",
          rule.depth_scale);
  require(rule.depth_weight >= 0 && std::isfinite(rule.depth_weight),
          "depth_weight must not be negative", rule.depth_weight);
  require(rule.alpha_min > 0 && rule.alpha_min <= 1, "alpha_min must be in (0, 1]", rule.alpha_min);
}

std::uint8_t is_nonzero(std::uint8_t value) { return value != 0; }

/// M' W M for the motion M = (-I | [x]x) of a point under a twist of the camera.
Matrix6 by_twist(const Eigen::Vector3d& point, const Eigen::Matrix3d& by_point) {
  Eigen::Matrix<double, 3, 6> motion;
  motion << -Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero();
  motion.rightCols<3>() << 0, -point.z(), point.y(), point.z(), 0, -point.x(), -point.y(),
      point.x(), 0;
  return motion.transpose() * by_point * motion;
}

}  // namespace

template <typename T>
struct ViewCost<T>::State {
  GaussianView<T> gaussians;
  RgbdView<T> view;
  CostRule rule;
  raster::Rasterizer<T> rasterizer;
  optim::Exposure exposure;
  std::vector<std::uint8_t> known;
  std::size_t wanted = 0;
  std::size_t pixels = 0;
  raster::Images<T> images;
  std::optional<Eigen::Matrix4d> rendered_at;
  int threads = 1;

  /// Of a function of the rows, in an order that does not depend on the threads.
  template <typename Sum, typename OfRow>
  Sum sum(const OfRow& of_row) const {
    const int height = view.camera.height;
    std::vector<Sum> parts(std::size_t(height + kRowsPerTask - 1) / kRowsPerTask);
    parallel::parallel_for(parts.size(), threads, [&](std::size_t task) {
      const int first = int(task) * kRowsPerTask;
      Sum part = of_row(first);
      for (int y = first + 1; y < std::min(height, first + kRowsPerTask); ++y) part += of_row(y);
      parts[task] = part;
    });
    Sum total = parts[0];
    for (std::size_t task = 1; task < parts.size(); ++task) total += parts[task];
    return total;
  }

  void settle(const Eigen::Isometry3d& pose);
  void fit_exposure();
  Fit fit() const;
  void render(const Eigen::Isometry3d& pose);
  std::array<T, 3> color_error(std::size_t pixel) const;
  std::optional<T> depth_error(std::size_t pixel) const;
  double cost_of_row(int y, T* dL_drgb, T* dL_ddepth) const;
  Matrix6 curvature_of_row(int y) const;
};

template <typename T>
void ViewCost<T>::State::render(const Eigen::Isometry3d& pose) {
  if (rendered_at && *rendered_at == pose.matrix()) return;
  rendered_at.reset();
  Camera camera = view.camera;
  camera.world_from_camera = pose;
  images = rasterizer.forward(gaussians, camera, rule.render,
                              {known.data(), camera.width, camera.height});
  rendered_at = pose.matrix();
}

template <typename T>
std::array<T, 3> ViewCost<T>::State::color_error(std::size_t pixel) const {
  std::array<T, 3> error;
  for (std::size_t c = 0; c < 3; ++c) {
    error[c] = T(exposure.gain[c]) * images.rgb[3 * pixel + c] + T(exposure.offset[c]) -
               view.photo[3 * pixel + c];
  }
  return error;
}

/// As a share of the measured depth; none where there is none.
template <typename T>
std::optional<T> ViewCost<T>::State::depth_error(std::size_t pixel) const {
  if (view.measured == nullptr) return std::nullopt;
  const T measured = view.measured[pixel], depth = images.depth[pixel];
  if (!(measured > 0) || !(depth > 0)) return std::nullopt;
  return (depth - measured) / measured;
}

/// Over the known pixels, twice: what shows something else tells nothing of the exposure.
template <typename T>
void ViewCost<T>::State::fit_exposure() {
  const int width = view.camera.width, height = view.camera.height;
  std::vector<std::uint8_t> alike = known;
  for (int round = 0; round < 2; ++round) {
    exposure = optim::fit_exposure(images.rgb.data(), view.photo, width, height,
                                   {alike.data(), width, height}, rule.render.threads);
    for (std::size_t pixel = 0; pixel < known.size(); ++pixel) {
      const std::array<T, 3> error = color_error(pixel);
      const T most = std::max({std::abs(error[0]), std::abs(error[1]), std::abs(error[2])});
      alike[pixel] = known[pixel] && most < T(kOtherThing);
    }
  }
}

template <typename T>
void ViewCost<T>::State::settle(const Eigen::Isometry3d& pose) {
  threads = parallel::resolve_threads(rule.render.threads);
  const std::size_t size = std::size_t(view.camera.width) * std::size_t(view.camera.height);
  known.assign(size, 1);
  if (view.mask != nullptr) std::transform(view.mask, view.mask + size, known.begin(), is_nonzero);
  wanted = std::size_t(std::count(known.begin(), known.end(), 1));
  render(pose);
  for (std::size_t pixel = 0; pixel < size; ++pixel) {
    known[pixel] = known[pixel] && images.alpha[pixel] >= T(rule.alpha_min);
  }
  pixels = std::size_t(std::count(known.begin(), known.end(), 1));
  fit_exposure();
}

template <typename T>
Fit ViewCost<T>::State::fit() const {
  std::size_t alike = 0, measured = 0, near = 0;
  for (std::size_t pixel = 0; pixel < known.size(); ++pixel) {
    if (!known[pixel]) continue;
    const std::array<T, 3> error = color_error(pixel);
    const T square = error[0] * error[0] + error[1] * error[1] + error[2] * error[2];
    alike += square < T(3 * rule.color_scale * rule.color_scale);
    const std::optional<T> off = depth_error(pixel);
    measured += off.has_value();
    near += off && std::abs(*off) < T(rule.depth_scale);
  }
  const auto share = [](std::size_t part, std::size_t whole) {
    return whole == 0 ? 0.0 : double(part) / double(whole);
  };
  return {share(pixels, wanted), share(alike, pixels), share(measured, pixels),
          share(near, measured)};
}

template <typename T>
double ViewCost<T>::State::cost_of_row(int y, T* dL_drgb, T* dL_ddepth) const {
  const T per_color = T(1 / (3 * rule.color_scale * rule.color_scale));
  const T per_depth = T(1 / (rule.depth_scale * rule.depth_scale));
  const T depth_weight = T(rule.depth_weight);
  double cost = 0;
  const int width = view.camera.width;
  for (std::size_t pixel = std::size_t(y) * width; pixel < std::size_t(y + 1) * width; ++pixel) {
    if (!known[pixel]) continue;
    const std::array<T, 3> e = color_error(pixel);
    const T s = (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) * per_color;
    cost += double(rho(s));
    const std::optional<T> off = depth_error(pixel);
    const T s_depth = off ? *off * *off * per_depth : T(0);
    if (off) cost += double(depth_weight * rho(s_depth));
    if (dL_drgb == nullptr) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      dL_drgb[3 * pixel + c] = weight(s) * per_color * e[c] * T(exposure.gain[c]);
    }
    if (off) {
      dL_ddepth[pixel] = depth_weight * weight(s_depth) * per_depth * *off / view.measured[pixel];
    }
  }
  return cost;
}

/// Where a pixel's surface would be seen if the camera moved a little, and how its colours and
/// depth would change: Gauss-Newton's curvature of direct image alignment (Kerl et al. 2013).
template <typename T>
Matrix6 ViewCost<T>::State::curvature_of_row(int y) const {
  const Camera& camera = view.camera;
  const int width = camera.width;
  const T per_color = T(1 / (3 * rule.color_scale * rule.color_scale));
  const T per_depth = T(1 / (rule.depth_scale * rule.depth_scale));
  Matrix6 total = Matrix6::Zero();
  const int start = 1 + (y / kCurvatureStep) % kCurvatureStep;
  for (int x = start; x + 1 < width; x += kCurvatureStep) {
    const std::size_t pixel = std::size_t(y) * width + x;
    const std::size_t left = pixel - 1, right = pixel + 1, up = pixel - width, down = pixel + width;
    if (!known[pixel] || !known[left] || !known[right] || !known[up] || !known[down]) continue;
    const double z = double(images.depth[pixel]);
    if (!(z > 0)) continue;
    const Eigen::Vector3d point((x + 0.5 - camera.cx) / camera.fx * z,
                                (y + 0.5 - camera.cy) / camera.fy * z, z);
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    pixel_by_point << camera.fx / z, 0, -camera.fx * point.x() / (z * z), 0, camera.fy / z,
        -camera.fy * point.y() / (z * z);
    const std::array<T, 3> e = color_error(pixel);
    const double w =
        double(weight((e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) * per_color) * per_color);
    Eigen::Matrix2d slopes = Eigen::Matrix2d::Zero();
    for (std::size_t c = 0; c < 3; ++c) {
      const auto color = [&](std::size_t at) { return double(images.rgb[3 * at + c]); };
      const Eigen::Vector2d slope(color(right) - color(left), color(down) - color(up));
      slopes += exposure.gain[c] * exposure.gain[c] / 4 * slope * slope.transpose();
    }
    Eigen::Matrix3d by_point = w * pixel_by_point.transpose() * slopes * pixel_by_point;
    const auto depth = [&](std::size_t at) { return double(images.depth[at]); };
    const Eigen::Vector2d depth_slope((depth(right) - depth(left)) / 2,
                                      (depth(down) - depth(up)) / 2);
    const std::optional<T> off = depth_error(pixel);
    if (off && depth_slope.cwiseAbs().maxCoeff() < kDepthEdge * z) {
      const double of_depth =
          rule.depth_weight * double(weight(*off * *off * per_depth) * per_depth);
      const double measured = double(view.measured[pixel]);
      const Eigen::RowVector3d row =
          (Eigen::RowVector3d::UnitZ() - depth_slope.transpose() * pixel_by_point) / measured;
      by_point += of_depth * row.transpose() * row;
    }
    total += by_twist(point, by_point);
  }
  return kCurvatureStep * kCurvatureStep * total;
}

template <typename T>
ViewCost<T>::ViewCost(const GaussianView<T>& gaussians, const RgbdView<T>& view,
                      const Eigen::Isometry3d& world_from_camera, const CostRule& rule)
    : state_(std::make_unique<State>()) {
  validate(rule);
  Camera camera = view.camera;
  camera.world_from_camera = world_from_camera;
  gslts::validate(camera, "ViewCost");
  if (view.photo == nullptr) throw std::invalid_argument("ViewCost: photo: there is none");
  state_->gaussians = gaussians;
  state_->view = view;
  state_->rule = rule;
  state_->settle(world_from_camera);
}

template <typename T>
ViewCost<T>::~ViewCost() = default;
template <typename T>
ViewCost<T>::ViewCost(ViewCost&&) noexcept = default;
template <typename T>
ViewCost<T>& ViewCost<T>::operator=(ViewCost&&) noexcept = default;

template <typename T>
Fit ViewCost<T>::fit(const Eigen::Isometry3d& world_from_camera) {
  state_->render(world_from_camera);
  return state_->fit();
}

template <typename T>
std::size_t ViewCost<T>::pixels() const {
  return state_->pixels;
}

template <typename T>
double ViewCost<T>::at(const Eigen::Isometry3d& world_from_camera) {
  State& state = *state_;
  state.render(world_from_camera);
  return state.sum<double>([&](int y) { return state.cost_of_row(y, nullptr, nullptr); });
}

template <typename T>
Linearization ViewCost<T>::linearized(const Eigen::Isometry3d& world_from_camera) {
  State& state = *state_;
  Linearization result;
  result.curvature = curvature(world_from_camera);
  Array<T> dL_drgb(3 * state.known.size()), dL_ddepth(state.known.size());
  std::fill(dL_drgb.begin(), dL_drgb.end(), T(0));
  std::fill(dL_ddepth.begin(), dL_ddepth.end(), T(0));
  result.cost = state.sum<double>(
      [&](int y) { return state.cost_of_row(y, dL_drgb.data(), dL_ddepth.data()); });
  raster::ImageGradients<T> gradients;
  gradients.dL_drgb = dL_drgb.data();
  gradients.dL_ddepth = dL_ddepth.data();
  const std::array<double, 6> twist =
      state.rasterizer.backward(state.gaussians, gradients).dL_dtwist;
  result.gradient = Eigen::Map<const Vector6>(twist.data());
  return result;
}

template <typename T>
Matrix6 ViewCost<T>::curvature(const Eigen::Isometry3d& world_from_camera) {
  State& state = *state_;
  state.render(world_from_camera);
  const int last = state.view.camera.height - 1;
  return state.sum<Matrix6>([&](int y) -> Matrix6 {
    const bool counts = y > 0 && y < last && y % kCurvatureStep == 0;
    return counts ? state.curvature_of_row(y) : Matrix6(Matrix6::Zero());
  });
}

template class ViewCost<float>;
template class ViewCost<double>;

}  // namespace gslts::align
