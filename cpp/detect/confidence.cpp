#include <algorithm>
#include <cmath>

#include "constants.hpp"
#include "gslts/detect/surface.hpp"
#include "logistic.hpp"

namespace gslts::detect {
namespace {

/// Logarithm of the share of cameras that saw through, near a half where there are few.
double log_seen_through(const Visibility& visibility) {
  return std::log((visibility.seen_through + kVisibilityPrior) /
                  (visibility.on_surface + visibility.seen_through + 2 * kVisibilityPrior));
}

Visibility visibility_of(const Surface& surface) {
  if (surface.visibility) return *surface.visibility;
  if (surface.side == Side::kBefore) return kTypicalBefore;
  return surface.flat ? kTypicalFlatAfter : kTypicalAfter;
}

}  // namespace

std::array<double, kConfidenceFeatures> confidence_features(const Surface& surface) {
  const Evidence& evidence = surface.evidence;
  const Visibility visibility = visibility_of(surface);
  const double colors = std::min(1.0, evidence.changed_share / kFullColorChange);
  const double seen_through = log_seen_through(visibility);
  const double log_area = std::log(surface.area_m2 + 1e-6);
  const double log_depth = std::log(surface.depth_m + 1e-3);
  const bool before = surface.side == Side::kBefore, flat = surface.flat;
  const double log_step =
      std::log(evidence.step_ratio * (kColorlessStep + (1 - kColorlessStep) * colors) + 0.01);
  return {
      flat ? 0 : log_step,
      flat ? log_step : 0,
      std::max(0.0, std::log(kNearDepth_m) - log_depth),
      std::log(surface.area_px + 1.0),
      std::log(evidence.thickness_m + 1e-3),
      flat ? 0 : evidence.attached_share,
      std::log(evidence.residual_color + 0.02),
      flat ? 0 : evidence.correlation,
      flat ? evidence.correlation : 0,
      std::log(evidence.ring_depth_m + 0.01),
      flat ? evidence.ring_color_ratio : 0,
      flat ? std::max(0.0, log_area - std::log(kMaxFlatArea_m2)) : 0,
      visibility.known_share,
      before ? seen_through : 0,
      before ? 0 : seen_through,
      before ? 1.0 : 0.0,
      std::log(evidence.depth_error_m + kMinDepthError_m),
      std::log(evidence.color_error + kMinColorError),
  };
}

double confidence(const Surface& surface) {
  if (surface.color_confidence) return *surface.color_confidence;
  return logistic(kConfidenceOffset, kConfidenceWeights, confidence_features(surface));
}

}  // namespace gslts::detect
