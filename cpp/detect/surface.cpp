#include "gslts/detect/surface.hpp"

#include <cmath>
#include <string>

#include "color_histogram.hpp"
#include "gslts/map/require.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

void require_finite(const char* function, const char* name, double value) {
  if (std::isfinite(value)) return;
  fail(function, (std::string(name) + " must be finite").c_str(), value);
}

void require_finite(const char* function, const char* name, const Eigen::Vector3d& values) {
  for (const double value : values) require_finite(function, name, value);
}

void require_magnitude(const char* function, const char* name, double value) {
  if (std::isfinite(value) && value >= 0) return;
  fail(function, (std::string(name) + " must be finite and at least 0").c_str(), value);
}

void require_histogram(const char* function, const std::vector<float>& shares) {
  if (shares.empty()) return;
  if (shares.size() != kHistogramBins) {
    const std::string bins = std::to_string(kHistogramBins);
    fail(function, ("color_histogram must have 0 or " + bins + " bins").c_str(), shares.size());
  }
  double sum = 0;
  for (const float share : shares) {
    require(share >= 0, function, "color_histogram must not be negative or NaN", share);
    sum += double(share);
  }
  require(std::abs(sum - 1) <= kMaxHistogramError, function, "color_histogram must sum up to 1",
          sum);
}

}  // namespace

void validate(const Evidence& evidence, const char* function) {
  require_magnitude(function, "step_ratio", evidence.step_ratio);
  require_in(function, "changed_share", evidence.changed_share, 0, 1);
  require_magnitude(function, "thickness_m", evidence.thickness_m);
  require_in(function, "attached_share", evidence.attached_share, 0, 1);
  require_magnitude(function, "residual_color", evidence.residual_color);
  require_finite(function, "correlation", evidence.correlation);
  require_magnitude(function, "ring_depth_m", evidence.ring_depth_m);
  require_magnitude(function, "ring_color_ratio", evidence.ring_color_ratio);
  require_magnitude(function, "depth_error_m", evidence.depth_error_m);
  require_magnitude(function, "color_error", evidence.color_error);
}

void validate(const Visibility& visibility, const char* function) {
  require_magnitude(function, "on_surface", visibility.on_surface);
  require_magnitude(function, "seen_through", visibility.seen_through);
  require_in(function, "known_share", visibility.known_share, 0, 1);
  require_in(function, "recorded_share", visibility.recorded_share, 0, 1);
  require_in(function, "free_share", visibility.free_share, 0, 1);
  require_in(function, "missing_share", visibility.missing_share, 0, 1);
}

void validate(const Surface& surface, const char* function) {
  require_finite(function, "point", surface.point);
  require_finite(function, "low", surface.low);
  require_finite(function, "high", surface.high);
  require_finite(function, "color", surface.color);
  for (const Eigen::Vector3d& sample : surface.samples) require_finite(function, "samples", sample);
  for (int c = 0; c < 3; ++c) {
    require(surface.low[c] <= surface.high[c], function, "low must not exceed high",
            surface.low[c]);
  }
  require_magnitude(function, "area_px", surface.area_px);
  require_magnitude(function, "area_m2", surface.area_m2);
  require_magnitude(function, "depth_m", surface.depth_m);
  require_finite(function, "step_m", surface.step_m);
  require_histogram(function, surface.color_histogram);
  validate(surface.evidence, function);
  if (surface.visibility) validate(*surface.visibility, function);
  if (surface.color_confidence) {
    require_in(function, "color_confidence", *surface.color_confidence, 0, 1);
  }
}

}  // namespace gslts::detect
