#include "gslts/edit/sightings.hpp"

#include <stdexcept>

#include "pixel_of.hpp"

namespace gslts::edit {

Sightings sightings_of(const GaussianView<float>& gaussians, const std::vector<DepthView>& views,
                       const DepthRule& rule) {
  validate(gaussians, "sightings_of");
  require_margin("sightings_of", "margin_m", rule.margin_m);
  require_margin("sightings_of", "margin_share", rule.margin_share);
  Sightings result{Array<std::int32_t>(gaussians.size, 0), Array<std::int32_t>(gaussians.size, 0)};
  for (const DepthView& view : views) {
    validate(view.camera, "sightings_of");
    if (!view.measured) throw std::invalid_argument("sightings_of: a view has no depth");
    const Projector project(view.camera, gaussians.origin);
    for (std::size_t i = 0; i < gaussians.size; ++i) {
      const auto pixel = project(gaussians.means + 3 * i);
      if (!pixel) continue;
      const double measured_m = double(view.measured[pixel->index]);
      if (!(measured_m > 0)) continue;  // NaN too.
      const double margin_m = rule.margin_m + rule.margin_share * pixel->depth_m;
      if (measured_m > pixel->depth_m + margin_m) {
        ++result.through[i];
      } else if (measured_m >= pixel->depth_m - margin_m) {
        ++result.on[i];
      }
    }
  }
  return result;
}

}  // namespace gslts::edit
