#include <algorithm>
#include <cmath>

#include "gslts/detect/surface.hpp"

namespace gslts::detect {
namespace {

/// Of the share of the sights that went through, careful where there are few.
double log_through(const Sights& sights) {
  constexpr double kPrior = 3;  // Sights of either sort.
  return std::log((sights.through + kPrior) / (sights.on + sights.through + 2 * kPrior));
}

/// Where no sights are known, they are as they mostly are of objects that changed.
Sights sights_of(const Surface& surface) {
  if (surface.sights) return *surface.sights;
  if (surface.side == Side::kBefore) return {975, 25, 1};
  return surface.flat ? Sights{900, 100, 1} : Sights{150, 850, 1};
}

}  // namespace

std::array<double, kFeatures> features_of(const Surface& surface) {
  constexpr double kLook = 0.3;      // Where so many pixels look otherwise, all of it does.
  constexpr double kBlind = 0.3;     // What steps count where nothing looks otherwise.
  constexpr double kLarge_m2 = 0.1;  // Flat things are smaller, light that moved is not.
  constexpr double kNear_m = 0.8;    // From nearer, a picture shows more than a map can.
  const Evidence& evidence = surface.evidence;
  const Sights sights = sights_of(surface);
  const double look = std::min(1.0, evidence.differing / kLook);
  const double through = log_through(sights);
  const double log_area = std::log(surface.area_m2 + 1e-6);
  const double log_depth = std::log(surface.depth_m + 1e-3);
  const bool before = surface.side == Side::kBefore, flat = surface.flat;
  return {
      std::log(evidence.steps * (kBlind + (1 - kBlind) * look) + 0.01),
      std::max(0.0, std::log(kNear_m) - log_depth),
      std::log(surface.area_px + 1.0),
      std::log(evidence.thickness_m + 1e-3),
      flat ? 0 : evidence.attached,
      std::log(evidence.unexplained + 0.02),
      flat ? 0 : evidence.correlation,
      flat ? evidence.correlation : 0,
      std::log(evidence.around_m + 0.01),
      flat ? evidence.around_color : 0,
      flat ? std::max(0.0, log_area - std::log(kLarge_m2)) : 0,
      sights.seen,
      before ? through : 0,
      before ? 0 : through,
      before ? 1.0 : 0.0,
  };
}

double certainty(const Surface& surface) {
  // Found by benchmarks/fit_certainty.py.
  constexpr double kOffset = -7.289;
  constexpr std::array<double, kFeatures> kWeights{1.076,  -4.054, -0.373, 2.862,  -4.021,
                                                   0.826,  -2.231, -6.450, -2.522, -10.178,
                                                   -2.281, 11.821, -0.349, 0.289,  -2.816};
  const std::array<double, kFeatures> features = features_of(surface);
  double sum = kOffset;
  for (std::size_t k = 0; k < kFeatures; ++k) sum += kWeights[k] * features[k];
  return 1 / (1 + std::exp(-sum));
}

}  // namespace gslts::detect
