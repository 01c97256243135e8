#include "gslts/detect/masks.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "mat.hpp"
#include "rules.hpp"

namespace gslts::detect {

Masks masks_of(const Views& views, const MaskRule& rule) {
  validate(views.camera, "masks_of");
  require_in("masks_of", "tau_gs", rule.tau_gs, 0, 3);
  require_in("masks_of", "tau_feat", rule.tau_feat, -1, 1);
  require_in("masks_of", "alpha_min", rule.alpha_min, 0, 1);
  require_in("masks_of", "clean_px", rule.clean_px, 0, 100);
  const std::size_t size = views.size();
  Masks masks{Array<std::uint8_t>(size), Array<std::uint8_t>(size), Array<std::uint8_t>(size),
              Array<std::uint8_t>(size)};
  for (std::size_t k = 0; k < size; ++k) {
    float difference = 0;
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      difference += std::abs(views.photo[c] - views.rgb[c]);
    }
    masks.known[k] = views.alpha[k] >= rule.alpha_min;
    masks.pixel[k] = difference > rule.tau_gs;
    masks.feature[k] = views.similarity[k] < rule.tau_feat;
    masks.combined[k] = masks.known[k] & masks.pixel[k] & masks.feature[k];
  }
  const cv::Mat combined = mask_of(masks.combined, views.camera);
  const int side = 2 * rule.clean_px + 1;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
  cv::morphologyEx(combined, combined, cv::MORPH_OPEN, disc);
  cv::morphologyEx(combined, combined, cv::MORPH_CLOSE, disc);
  return masks;
}

}  // namespace gslts::detect
