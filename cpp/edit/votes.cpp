#include "gslts/edit/votes.hpp"

#include <stdexcept>

#include "pixel_of.hpp"

namespace gslts::edit {

Votes votes_of(const GaussianView<float>& gaussians, const std::vector<VotingView>& views,
               const VoteRule& rule) {
  validate(gaussians, "votes_of");
  require_margin("votes_of", "behind_m", rule.behind_m);
  require_margin("votes_of", "behind_share", rule.behind_share);
  Votes result{Array<std::int32_t>(gaussians.size, 0), Array<std::int32_t>(gaussians.size, 0)};
  for (const VotingView& view : views) {
    validate(view.camera, "votes_of");
    if (!view.mask) throw std::invalid_argument("votes_of: a view has no mask");
    const Projector project(view.camera, gaussians.origin);
    for (std::size_t i = 0; i < gaussians.size; ++i) {
      const auto pixel = project(gaussians.means + 3 * i);
      if (!pixel) continue;
      if (view.rendered) {
        const double surface_m = double(view.rendered[pixel->index]);
        const double behind_m = rule.behind_m + rule.behind_share * surface_m;
        // Where the map shows nothing, nothing hides the Gaussian.
        if (surface_m > 0 && pixel->depth_m > surface_m + behind_m) continue;
      }
      ++result.views[i];
      if (view.mask[pixel->index]) ++result.votes[i];
    }
  }
  return result;
}

}  // namespace gslts::edit
