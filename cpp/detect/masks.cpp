#include "gslts/detect/masks.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "images.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

void validate(const MaskRule& rule) {
  require_in("compute_masks", "tau_gs", rule.tau_gs, 0, 3);
  require_in("compute_masks", "tau_feat", rule.tau_feat, -1, 1);
  require_in("compute_masks", "alpha_min", rule.alpha_min, 0, 1);
  require_in("compute_masks", "clean_px", rule.clean_px, 0, 100);
}

}  // namespace

Masks compute_masks(const Views& views, const MaskRule& rule) {
  gslts::validate(views.camera, "compute_masks");
  validate(rule);
  const std::size_t size = views.size();
  Masks masks{Array<std::uint8_t>(size), Array<std::uint8_t>(size), Array<std::uint8_t>(size),
              Array<std::uint8_t>(size)};
  for (std::size_t k = 0; k < size; ++k) {
    float difference = 0;
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      difference += std::abs(views.observed_rgb[c] - views.rendered_rgb[c]);
    }
    masks.known[k] = views.alpha[k] >= rule.alpha_min;
    masks.pixel[k] = difference > rule.tau_gs;
    masks.feature[k] = views.similarity[k] < rule.tau_feat;
    masks.combined[k] = masks.known[k] & masks.pixel[k] & masks.feature[k];
  }
  const cv::Mat combined = image_of(masks.combined, views.camera);
  cv::morphologyEx(combined, combined, cv::MORPH_OPEN, disc(rule.clean_px));
  cv::morphologyEx(combined, combined, cv::MORPH_CLOSE, disc(rule.clean_px));
  return masks;
}

}  // namespace gslts::detect
