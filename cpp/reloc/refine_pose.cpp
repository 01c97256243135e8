#include "gslts/reloc/refine_pose.hpp"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace gslts::reloc {
namespace {

using align::CostRule;
using align::Linearization;
using align::Matrix6;
using align::RgbdView;
using align::Vector6;
using align::ViewCost;

/// Of the curvature's trace, so that it can be factored.
constexpr double kRidge = 1e-12;
/// What a start is worth, so that a direction that a picture tells nothing about stays: that many
/// pixels that say so, with a trust in it of so many m and rad. A view has some 100,000.
constexpr double kStartPixels = 5, kStartStd = 0.1;
/// Of the cost: a step that gains less is the last one at its resolution.
constexpr double kLeastGain = 1e-4;
/// Pixels below which a view says nothing.
constexpr std::size_t kLeastPixels = 64;

Eigen::Matrix3d rotation(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, phi / angle).toRotationMatrix();
}

Eigen::Matrix3d cross(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return matrix;
}

/// J with rotation(phi + d) = rotation(phi) rotation(J d) for small d (Sola et al. 2018, eq. 143).
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi) {
  const double square = phi.squaredNorm();
  if (square < 1e-12) return Eigen::Matrix3d::Identity() - cross(phi) / 2;
  const double angle = std::sqrt(square);
  return Eigen::Matrix3d::Identity() - (1 - std::cos(angle)) / square * cross(phi) +
         (angle - std::sin(angle)) / (square * angle) * cross(phi) * cross(phi);
}

/// start * (rotation(phi), rho) for x = (rho, phi).
Eigen::Isometry3d moved(const Eigen::Isometry3d& start, const double* x) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translation() = Eigen::Vector3d(x[0], x[1], x[2]);
  motion.linear() = rotation({x[3], x[4], x[5]});
  return start * motion;
}

/// The cost of a view as seven residuals, whose Jacobian has the exact gradient and the curvature
/// of the millions that they stand for: with H = L L', J = L' and r = L^-1 g, a last residual
/// without slope makes up for the rest of the cost.
class CondensedCost final : public ceres::SizedCostFunction<7, 6> {
 public:
  CondensedCost(ViewCost<float>& view, const Eigen::Isometry3d& start)
      : view_(view), start_(start) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const double* x = parameters[0];
    for (int i = 0; i < 6; ++i) {
      if (!std::isfinite(x[i])) return false;
    }
    Eigen::Map<Eigen::Matrix<double, 7, 1>> residual(residuals);
    residual.setZero();
    const Eigen::Isometry3d pose = moved(start_, x);
    if (jacobians == nullptr || jacobians[0] == nullptr) {
      residual[6] = std::sqrt(2 * view_.at(pose));
      return true;
    }
    const Linearization at = view_.linearized(pose);
    // From twists at this pose to changes of x.
    Matrix6 twist_by_x = Matrix6::Zero();
    twist_by_x.topLeftCorner<3, 3>() = rotation({x[3], x[4], x[5]}).transpose();
    twist_by_x.bottomRightCorner<3, 3>() = right_jacobian({x[3], x[4], x[5]});
    const Vector6 gradient = twist_by_x.transpose() * at.gradient;
    Matrix6 curvature = twist_by_x.transpose() * at.curvature * twist_by_x;
    curvature.diagonal().array() += kRidge * (curvature.trace() + 1);
    Eigen::LLT<Matrix6> factor(curvature);
    if (factor.info() != Eigen::Success) return false;
    // What a quadratic of this curvature could gain at most must not be more than there is.
    const double gain = gradient.dot(factor.solve(gradient));
    if (gain > 2 * at.cost && at.cost > 0) factor.compute(curvature * (gain / (2 * at.cost)));
    const Vector6 steep = factor.matrixL().solve(gradient);
    residual.head<6>() = steep;
    residual[6] = std::sqrt(std::max(0.0, 2 * at.cost - steep.squaredNorm()));
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> jacobian(jacobians[0]);
    jacobian.setZero();
    jacobian.topRows<6>() = factor.matrixU();
    return jacobian.allFinite() && residual.allFinite();
  }

 private:
  ViewCost<float>& view_;
  Eigen::Isometry3d start_;
};

/// Ends a solve when its last step was too short to matter.
class ShortStep final : public ceres::IterationCallback {
 public:
  explicit ShortStep(double least_m) : least_m_(least_m) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const bool is_short = summary.iteration > 0 && summary.step_norm < least_m_;
    return is_short ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double least_m_;
};

/// Of the pixels that count; infinite if none does.
double mean_at(ViewCost<float>& cost, const Eigen::Isometry3d& pose) {
  if (cost.pixels() < kLeastPixels) return std::numeric_limits<double>::infinity();
  return cost.at(pose) / double(cost.pixels());
}

void validate(const RefineRule& rule) {
  if (rule.iterations < 0) {
    throw std::invalid_argument("refine_pose: iterations must not be negative, got " +
                                std::to_string(rule.iterations));
  }
  if (!(rule.least_step_m >= 0)) {
    throw std::invalid_argument("refine_pose: least_step_m must not be negative, got " +
                                std::to_string(rule.least_step_m));
  }
}

}  // namespace

RefinedPose refine_pose(const std::vector<GaussianView<float>>& maps,
                        const std::vector<RgbdView<float>>& views, const Eigen::Isometry3d& start,
                        const RefineRule& rule) {
  validate(rule);
  if (views.empty()) throw std::invalid_argument("refine_pose: views: there is none");
  if (maps.size() != 1 && maps.size() != views.size()) {
    throw std::invalid_argument("refine_pose: maps: expected one, or one a view, got " +
                                std::to_string(maps.size()));
  }
  RefinedPose result;
  result.world_from_camera = start;
  std::optional<ViewCost<float>> cost;
  for (std::size_t k = 0; k < views.size(); ++k) {
    // Far from the optimum nearly all looks like something else: trust ends later there, and less
    // of a pose is worth a step.
    const double coarseness = std::ldexp(1.0, int(views.size() - 1 - k));
    CostRule wide = rule.cost;
    wide.color_scale *= coarseness;
    wide.depth_scale *= coarseness;
    const GaussianView<float>& gaussians = maps.size() == 1 ? maps[0] : maps[k];
    cost.emplace(gaussians, views[k], result.world_from_camera, wide);
    if (k == 1) {
      // A pixel of the coarsest picture may be wider than the start was off.
      ViewCost<float> at_start(gaussians, views[k], start, wide);
      if (mean_at(at_start, start) < mean_at(*cost, result.world_from_camera)) {
        result.world_from_camera = start;
        cost = std::move(at_start);
      }
    }
    result.converged = false;
    if (cost->pixels() < kLeastPixels) continue;
    Vector6 x = Vector6::Zero();
    CondensedCost condensed(*cost, result.world_from_camera);
    ShortStep short_step(rule.least_step_m * coarseness);
    ceres::Problem::Options owning;
    owning.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(owning);
    problem.AddResidualBlock(&condensed, nullptr, x.data());
    ceres::NormalPrior start_prior(
        std::sqrt(kStartPixels) / kStartStd * ceres::Matrix::Identity(6, 6),
        ceres::Vector::Zero(6));
    problem.AddResidualBlock(&start_prior, nullptr, x.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = rule.iterations;
    options.function_tolerance = kLeastGain;
    options.logging_type = ceres::SILENT;
    options.callbacks.push_back(&short_step);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !x.allFinite()) continue;
    result.world_from_camera = moved(result.world_from_camera, x.data());
    result.iterations += int(summary.num_successful_steps);
    result.converged = summary.termination_type != ceres::NO_CONVERGENCE;
  }
  if (views.size() == 1) {  // Which may have begun far from there.
    cost.emplace(maps[0], views[0], result.world_from_camera, rule.cost);
  }
  result.fit = cost->fit(result.world_from_camera);
  if (cost->pixels() < kLeastPixels) {
    result.converged = false;
    return result;
  }
  result.curvature = cost->curvature(result.world_from_camera);
  result.cost = cost->at(result.world_from_camera) / double(cost->pixels());
  return result;
}

}  // namespace gslts::reloc
