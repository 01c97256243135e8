#include "gslts/edit/visibility.hpp"

#include <stdexcept>

#include "projector.hpp"

namespace gslts::edit {

VisibilityCounts count_visibility(const GaussianView<float>& gaussians,
                                  const std::vector<DepthView>& views,
                                  const DepthTolerance& tolerance) {
  validate(gaussians, "count_visibility");
  require_margin("count_visibility", "margin_m", tolerance.margin_m);
  require_margin("count_visibility", "margin_share", tolerance.margin_share);
  VisibilityCounts counts{Array<std::int32_t>(gaussians.size, 0),
                          Array<std::int32_t>(gaussians.size, 0)};
  for (const DepthView& view : views) {
    validate(view.camera, "count_visibility");
    if (!view.observed_depth) {
      throw std::invalid_argument("count_visibility: a view has no depth");
    }
    for_each_projection(gaussians, view.camera, [&](std::size_t i, const Pixel& pixel) {
      const double observed_m = double(view.observed_depth[pixel.index]);
      if (!(observed_m > 0)) return;  // NaN too.
      const double margin_m = tolerance.margin_m + tolerance.margin_share * pixel.depth_m;
      if (observed_m > pixel.depth_m + margin_m) {
        ++counts.seen_through[i];
      } else if (observed_m >= pixel.depth_m - margin_m) {
        ++counts.on_surface[i];
      }
    });
  }
  return counts;
}

}  // namespace gslts::edit
