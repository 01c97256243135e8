#include "gslts/reloc/refine_pose.hpp"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "gslts/map/require.hpp"
#include "gslts/map/se3.hpp"

namespace gslts::reloc {
namespace {

using align::CostRule;
using align::Linearization;
using align::RgbdView;
using align::ViewCost;

/// Share of the curvature's trace that is added to its diagonal, so that it can be factored.
constexpr double kRidge = 1e-12;
/// Weight of the start, so that directions which the image does not constrain stay: it counts as
/// this number of pixels, with this standard deviation (m and rad). A view has some 100,000 pixels.
constexpr double kStartPixels = 5, kStartStd = 0.1;
/// Relative decrease of the cost below which a step is the last one at its resolution.
constexpr double kMinDecrease = 1e-4;
/// Minimum number of known pixels of a view.
constexpr std::size_t kMinPixels = 64;

/// The cost of a view as seven residuals, whose Jacobian has its exact gradient and its curvature:
/// with H = L L', J = L' and r = L^-1 g; a last residual without slope makes up for the rest.
class CondensedCost final : public ceres::SizedCostFunction<7, 6> {
 public:
  CondensedCost(ViewCost<float>& view, const Eigen::Isometry3d& start)
      : view_(view), start_(start) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Vector6 x = Eigen::Map<const Vector6>(parameters[0]);
    if (!x.allFinite()) return false;
    const Eigen::Isometry3d pose = se3_retract(start_, x);
    Eigen::Map<Vector7> residual(residuals);
    residual.setZero();
    if (jacobians == nullptr || jacobians[0] == nullptr) {
      residual[6] = std::sqrt(2 * view_.at(pose));
      return true;
    }
    Linearization cost = view_.linearize(pose);
    change_variables(x, cost);
    Eigen::Map<Jacobian> jacobian(jacobians[0]);
    if (!condense(cost, residual, jacobian)) {
      // Ceres would print that the evaluation failed.
      failed_ = true;
      residual.setZero();
      jacobian.setZero();
    }
    return true;
  }

  /// True if derivatives could not be used at some pose: then the result is of no use.
  bool failed() const { return failed_; }

 private:
  using Vector7 = Eigen::Matrix<double, 7, 1>;
  using Jacobian = Eigen::Matrix<double, 7, 6, Eigen::RowMajor>;

  /// Turns derivatives by a twist at the pose into those by x.
  static void change_variables(const Vector6& x, Linearization& cost) {
    Matrix6 twist_by_x = Matrix6::Zero();
    twist_by_x.topLeftCorner<3, 3>() = rotation_from_vector(x.tail<3>()).transpose();
    twist_by_x.bottomRightCorner<3, 3>() = right_jacobian(x.tail<3>());
    cost.gradient = (twist_by_x.transpose() * cost.gradient).eval();
    cost.curvature = (twist_by_x.transpose() * cost.curvature * twist_by_x).eval();
  }

  static bool condense(Linearization& cost, Eigen::Map<Vector7>& residual,
                       Eigen::Map<Jacobian>& jacobian) {
    Matrix6& curvature = cost.curvature;
    curvature.diagonal().array() += kRidge * (curvature.trace() + 1);
    Eigen::LLT<Matrix6> factor(curvature);
    if (factor.info() != Eigen::Success) return false;
    // The quadratic model must not promise a greater decrease than the cost itself.
    const double decrease = cost.gradient.dot(factor.solve(cost.gradient));
    if (decrease > 2 * cost.cost && cost.cost > 0) {
      factor.compute(curvature * (decrease / (2 * cost.cost)));
    }
    const Vector6 steep = factor.matrixL().solve(cost.gradient);
    residual.head<6>() = steep;
    residual[6] = std::sqrt(std::max(0.0, 2 * cost.cost - steep.squaredNorm()));
    jacobian.setZero();
    jacobian.topRows<6>() = factor.matrixU();
    return jacobian.allFinite() && residual.allFinite();
  }

  ViewCost<float>& view_;
  Eigen::Isometry3d start_;
  mutable bool failed_ = false;
};

/// Ends a solve after a step that is too short to matter.
class ShortStep final : public ceres::IterationCallback {
 public:
  explicit ShortStep(double min_step_m) : min_step_m_(min_step_m) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const bool is_short = summary.iteration > 0 && summary.step_norm < min_step_m_;
    return is_short ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double min_step_m_;
};

/// Mean cost of the known pixels; infinite if there are too few.
double mean_at(ViewCost<float>& cost, const Eigen::Isometry3d& pose) {
  if (cost.pixels() < kMinPixels) return std::numeric_limits<double>::infinity();
  return cost.at(pose) / double(cost.pixels());
}

/// Minimises the cost of one view near `pose`.
/// @param min_step_m  Length of a step, m and rad, below which it is the last one.
/// @return  The pose, the number of steps and whether they converged; nothing if none was usable.
std::optional<RefinedPose> minimize(ViewCost<float>& cost, const Eigen::Isometry3d& pose,
                                    int iterations, double min_step_m) {
  Vector6 x = Vector6::Zero();
  CondensedCost condensed(cost, pose);
  ShortStep short_step(min_step_m);
  ceres::Problem::Options owning;
  owning.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(owning);
  problem.AddResidualBlock(&condensed, nullptr, x.data());
  ceres::NormalPrior start_prior(
      std::sqrt(kStartPixels) / kStartStd * ceres::Matrix::Identity(6, 6), ceres::Vector::Zero(6));
  problem.AddResidualBlock(&start_prior, nullptr, x.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = iterations;
  options.function_tolerance = kMinDecrease;
  options.logging_type = ceres::SILENT;
  options.callbacks.push_back(&short_step);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (condensed.failed() || !summary.IsSolutionUsable() || !x.allFinite()) return std::nullopt;
  RefinedPose result;
  result.world_from_camera = se3_retract(pose, x);
  result.iterations = int(summary.num_successful_steps);
  result.converged = summary.termination_type != ceres::NO_CONVERGENCE;
  return result;
}

void validate(const std::vector<GaussianView<float>>& maps,
              const std::vector<RgbdView<float>>& views, const RefineRule& rule) {
  constexpr const char* kFunction = "refine_pose";
  require(rule.iterations >= 0, kFunction, "iterations must not be negative", rule.iterations);
  require(rule.min_step_m >= 0, kFunction, "min_step_m must not be negative", rule.min_step_m);
  if (views.empty()) throw std::invalid_argument("refine_pose: views must not be empty");
  require(maps.size() == 1 || maps.size() == views.size(), kFunction,
          "maps must be one, or one per view", maps.size());
}

}  // namespace

RefinedPose refine_pose(const std::vector<GaussianView<float>>& maps,
                        const std::vector<RgbdView<float>>& views, const Eigen::Isometry3d& start,
                        const RefineRule& rule) {
  validate(maps, views, rule);
  RefinedPose result;
  result.world_from_camera = start;
  std::optional<ViewCost<float>> cost;
  for (std::size_t k = 0; k < views.size(); ++k) {
    // Far from the optimum nearly all pixels look like outliers: coarse resolutions have wider
    // scales, and need less precise steps.
    const double coarseness = std::ldexp(1.0, int(views.size() - 1 - k));
    CostRule wide = rule.cost;
    wide.color_scale *= coarseness;
    wide.depth_scale *= coarseness;
    const GaussianView<float>& gaussians = maps.size() == 1 ? maps[0] : maps[k];
    cost.emplace(gaussians, views[k], result.world_from_camera, wide);
    if (k == 1) {
      // A pixel of the coarsest image may be wider than the error of the start.
      ViewCost<float> at_start(gaussians, views[k], start, wide);
      if (mean_at(at_start, start) < mean_at(*cost, result.world_from_camera)) {
        result.world_from_camera = start;
        cost = std::move(at_start);
      }
    }
    result.converged = false;
    if (cost->pixels() < kMinPixels) continue;
    const auto found =
        minimize(*cost, result.world_from_camera, rule.iterations, rule.min_step_m * coarseness);
    if (!found) continue;
    result.world_from_camera = found->world_from_camera;
    result.iterations += found->iterations;
    result.converged = found->converged;
  }
  if (views.size() == 1) {  // Known pixels were settled at the start, which may be far from here.
    cost.emplace(maps[0], views[0], result.world_from_camera, rule.cost);
  }
  result.fit = cost->fit(result.world_from_camera);
  if (cost->pixels() < kMinPixels) {
    result.converged = false;
    return result;
  }
  result.curvature = cost->curvature(result.world_from_camera);
  result.cost = cost->at(result.world_from_camera) / double(cost->pixels());
  return result;
}

}  // namespace gslts::reloc
