#include "constants.hpp"
#include "gslts/detect/objects.hpp"
#include "rules.hpp"

namespace gslts::detect {

void validate(const ObjectRule& rule, const char* function) {
  require_in(function, "step_sigmas", rule.step_sigmas, kMinDivisor, 100);
  require_in(function, "step_px", rule.step_px, 0, 100);
  require_in(function, "edge_tolerance_px", rule.edge_tolerance_px, 0, 100);
  require_in(function, "min_area_m2", rule.min_area_m2, 0, 100);
  require_in(function, "min_area_px", rule.min_area_px, 1, 1e9);
  require_in(function, "min_flat_area_m2", rule.min_flat_area_m2, 0, 100);
  require_in(function, "min_flat_color", rule.min_flat_color, kMinDivisor, 3);
  require_in(function, "min_flat_step_m", rule.min_flat_step_m, 0, 10);
  require_in(function, "min_flat_contrast", rule.min_flat_contrast, 0, 10);
  require_in(function, "min_match_score", rule.min_match_score, 0, 1);
  require_in(function, "min_confidence", rule.min_confidence, 0, 1);
}

}  // namespace gslts::detect
