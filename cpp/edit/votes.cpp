#include "gslts/edit/votes.hpp"

#include <stdexcept>

#include "projector.hpp"

namespace gslts::edit {

Votes count_votes(const GaussianView<float>& gaussians, const std::vector<VotingView>& views,
                  const VoteRule& rule) {
  validate(gaussians, "count_votes");
  require_margin("count_votes", "behind_m", rule.behind_m);
  require_margin("count_votes", "behind_share", rule.behind_share);
  Votes result{Array<std::int32_t>(gaussians.size, 0), Array<std::int32_t>(gaussians.size, 0)};
  for (const VotingView& view : views) {
    validate(view.camera, "count_votes");
    if (!view.mask) throw std::invalid_argument("count_votes: a view has no mask");
    const auto is_hidden = [&](const Pixel& pixel) {
      if (!view.rendered_depth) return false;
      const double surface_m = double(view.rendered_depth[pixel.index]);
      const double behind_m = rule.behind_m + rule.behind_share * surface_m;
      // Where the map shows nothing, nothing hides the Gaussian.
      return surface_m > 0 && pixel.depth_m > surface_m + behind_m;
    };
    for_each_projection(gaussians, view.camera, [&](std::size_t i, const Pixel& pixel) {
      if (is_hidden(pixel)) return;
      ++result.views[i];
      if (view.mask[pixel.index]) ++result.votes[i];
    });
  }
  return result;
}

}  // namespace gslts::edit
