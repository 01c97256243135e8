#include "gslts/detect/objects.hpp"
#include "rules.hpp"

namespace gslts::detect {

void validate(const ObjectRule& rule, const char* function) {
  require_in(function, "step_m", rule.step_m, 0, 10);
  require_in(function, "step_per_m", rule.step_per_m, 0, 10);
  require_in(function, "step_px", rule.step_px, 0, 100);
  require_in(function, "reach_px", rule.reach_px, 0, 100);
  require_in(function, "least_area_m2", rule.least_area_m2, 0, 100);
  require_in(function, "least_area_px", rule.least_area_px, 1, 1e9);
  require_in(function, "flat_area_m2", rule.flat_area_m2, 0, 100);
  require_in(function, "flat_color", rule.flat_color, 0, 3);
  require_in(function, "flat_step_m", rule.flat_step_m, 0, 10);
  require_in(function, "least_contrast", rule.least_contrast, 0, 10);
  require_in(function, "alike", rule.alike, 0, 1);
  require_in(function, "certain", rule.certain, 0, 1);
}

}  // namespace gslts::detect
