#include "gslts/align/view_cost.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "gslts/map/require.hpp"
#include "gslts/optim/losses.hpp"
#include "gslts/parallel/parallel_for.hpp"
#include "robust.hpp"
#include "surface_jacobian.hpp"

namespace gslts::align {
namespace {

/// Rows of one task.
constexpr int kRowsPerTask = 8;
/// Step of the columns and rows whose pixels give the curvature, which is smooth.
constexpr int kCurvatureStep = 2;

void validate(const CostRule& rule) {
  constexpr const char* kFunction = "ViewCost";
  require(rule.color_scale > 0 && std::isfinite(rule.color_scale), kFunction,
          "color_scale must be positive", rule.color_scale);
  require(rule.depth_scale > 0 && std::isfinite(rule.depth_scale), kFunction,
          "depth_scale must be positive", rule.depth_scale);
  require(rule.depth_weight >= 0 && std::isfinite(rule.depth_weight), kFunction,
          "depth_weight must not be negative", rule.depth_weight);
  require(rule.alpha_min > 0 && rule.alpha_min <= 1, kFunction, "alpha_min must be in (0, 1]",
          rule.alpha_min);
}

std::uint8_t is_nonzero(std::uint8_t value) { return value != 0; }

/// Weights of squared errors: the inverse squares of the scales of the loss.
template <typename T>
struct Scales {
  explicit Scales(const CostRule& rule)
      : color(T(1 / (3 * rule.color_scale * rule.color_scale))),
        depth(T(1 / (rule.depth_scale * rule.depth_scale))),
        depth_weight(T(rule.depth_weight)) {}

  T color, depth, depth_weight;
};

template <typename T>
T squared_norm(const std::array<T, 3>& v) {
  return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

}  // namespace

template <typename T>
struct ViewCost<T>::State {
  GaussianView<T> gaussians;
  RgbdView<T> view;
  CostRule rule;
  raster::Rasterizer<T> rasterizer;
  optim::Exposure exposure;
  std::vector<std::uint8_t> known;  ///< [H,W] 1 where a pixel counts.
  std::size_t wanted = 0;           ///< Pixels of the mask.
  std::size_t pixels = 0;           ///< Pixels that count.
  raster::Images<T> images;         ///< Rendered at `rendered_at`.
  std::optional<Eigen::Matrix4d> rendered_at;
  int threads = 1;

  /// Sums a function of the rows, in an order that does not depend on the threads.
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
  void add_curvature(std::size_t pixel, Surface<T>& surface, EquationSums<T, 6>& sums) const;
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

/// Difference of the colours, rendered less observed.
template <typename T>
std::array<T, 3> ViewCost<T>::State::color_error(std::size_t pixel) const {
  std::array<T, 3> error;
  for (std::size_t c = 0; c < 3; ++c) {
    error[c] = T(exposure.gain[c]) * images.rgb[3 * pixel + c] + T(exposure.offset[c]) -
               view.photo[3 * pixel + c];
  }
  return error;
}

/// Difference of the depths, rendered less measured, over the measured one; none without depth.
template <typename T>
std::optional<T> ViewCost<T>::State::depth_error(std::size_t pixel) const {
  if (view.measured == nullptr) return std::nullopt;
  const T measured = view.measured[pixel], depth = images.depth[pixel];
  if (!(measured > 0) || !(depth > 0)) return std::nullopt;
  return (depth - measured) / measured;
}

/// Fits the exposure twice over the known pixels, the second time without outliers.
template <typename T>
void ViewCost<T>::State::fit_exposure() {
  const int width = view.camera.width, height = view.camera.height;
  std::vector<std::uint8_t> inliers = known;
  for (int round = 0; round < 2; ++round) {
    exposure = optim::fit_exposure(images.rgb.data(), view.photo, width, height,
                                   {inliers.data(), width, height}, rule.render.threads);
    for (std::size_t pixel = 0; pixel < known.size(); ++pixel) {
      const std::array<T, 3> error = color_error(pixel);
      const T greatest = std::max({std::abs(error[0]), std::abs(error[1]), std::abs(error[2])});
      inliers[pixel] = known[pixel] && greatest < T(kGreyOutlier);
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
    alike += squared_norm(color_error(pixel)) < T(3 * rule.color_scale * rule.color_scale);
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

/// Cost of a row of pixels.
/// @param dL_drgb, dL_ddepth  [H,W,3], [H,W] gradients that are written for the row; both or none
///   are null.
template <typename T>
double ViewCost<T>::State::cost_of_row(int y, T* dL_drgb, T* dL_ddepth) const {
  const Scales<T> scales(rule);
  double cost = 0;
  const int width = view.camera.width;
  for (std::size_t pixel = std::size_t(y) * width; pixel < std::size_t(y + 1) * width; ++pixel) {
    if (!known[pixel]) continue;
    const std::array<T, 3> error = color_error(pixel);
    const T s = squared_norm(error) * scales.color;
    cost += double(geman_mcclure(s));
    const std::optional<T> off = depth_error(pixel);
    const T s_depth = off ? *off * *off * scales.depth : T(0);
    if (off) cost += double(scales.depth_weight * geman_mcclure(s_depth));
    if (dL_drgb == nullptr) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      dL_drgb[3 * pixel + c] =
          geman_mcclure_weight(s) * scales.color * error[c] * T(exposure.gain[c]);
    }
    if (off) {
      dL_ddepth[pixel] = scales.depth_weight * geman_mcclure_weight(s_depth) * scales.depth * *off /
                         view.measured[pixel];
    }
  }
  return cost;
}

/// Adds a pixel to the Gauss-Newton curvature: three rows of its colours and one of its depth.
template <typename T>
void ViewCost<T>::State::add_curvature(std::size_t pixel, Surface<T>& surface,
                                       EquationSums<T, 6>& sums) const {
  const Scales<T> scales(rule);
  const std::ptrdiff_t width = view.camera.width;
  T row[6];
  const T color_weight =
      geman_mcclure_weight(squared_norm(color_error(pixel)) * scales.color) * scales.color;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto differences = central_differences(&images.rgb[3 * pixel + c], 3, 3 * width);
    const T gain = T(exposure.gain[c]);
    surface.set_slope(gain * differences.right, gain * differences.down);
    surface.write_twist(row);
    sums.add(row, T(0), color_weight);
  }
  const std::optional<T> off = depth_error(pixel);
  if (!off || is_depth_edge(&images.depth[pixel], width)) return;
  const auto differences = central_differences(&images.depth[pixel], 1, width);
  surface.set_depth_slope(differences.right, differences.down, view.measured[pixel]);
  surface.write_twist(row);
  const T s_depth = *off * *off * scales.depth;
  sums.add(row, T(0), scales.depth_weight * geman_mcclure_weight(s_depth) * scales.depth);
}

template <typename T>
Matrix6 ViewCost<T>::State::curvature_of_row(int y) const {
  const Camera& camera = view.camera;
  const int width = camera.width;
  const T fx = T(camera.fx), fy = T(camera.fy);
  EquationSums<T, 6> sums;
  const int start = 1 + (y / kCurvatureStep) % kCurvatureStep;
  for (int x = start; x + 1 < width; x += kCurvatureStep) {
    const std::size_t pixel = std::size_t(y) * width + x;
    const T z = images.depth[pixel];
    if (!known[pixel] || !known[pixel - 1] || !known[pixel + 1] || !known[pixel - width] ||
        !known[pixel + width] || !(z > 0)) {
      continue;
    }
    Surface<T> surface{
        {(T(x + 0.5) - T(camera.cx)) / fx * z, (T(y + 0.5) - T(camera.cy)) / fy * z, z}, fx, fy};
    add_curvature(pixel, surface, sums);
  }
  Matrix6 total;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) total(i, j) = double(sums.hessian[i][j]);
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
  if (view.photo == nullptr) throw std::invalid_argument("ViewCost: view.photo must not be null");
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
  return state.template sum<double>([&](int y) { return state.cost_of_row(y, nullptr, nullptr); });
}

template <typename T>
Linearization ViewCost<T>::linearize(const Eigen::Isometry3d& world_from_camera) {
  State& state = *state_;
  Linearization result;
  result.curvature = curvature(world_from_camera);
  Array<T> dL_drgb(3 * state.known.size()), dL_ddepth(state.known.size());
  std::fill(dL_drgb.begin(), dL_drgb.end(), T(0));
  std::fill(dL_ddepth.begin(), dL_ddepth.end(), T(0));
  result.cost = state.template sum<double>(
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
  return state.template sum<Matrix6>([&](int y) -> Matrix6 {
    const bool counts = y > 0 && y < last && y % kCurvatureStep == 0;
    return counts ? state.curvature_of_row(y) : Matrix6(Matrix6::Zero());
  });
}

template class ViewCost<float>;
template class ViewCost<double>;

}  // namespace gslts::align
