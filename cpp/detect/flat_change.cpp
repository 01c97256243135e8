#include "flat_change.hpp"

#include <algorithm>
#include <cmath>

#include "images.hpp"

namespace gslts::detect {
namespace {

/// Computes how far the colours of an image are outside the range of another image around them.
cv::Mat outside_range(const cv::Mat& colors, const cv::Mat& other, int radius_px) {
  cv::Mat low, high;
  cv::erode(other, low, square(radius_px));
  cv::dilate(other, high, square(radius_px));
  cv::Mat sum(colors.size(), CV_32F);
  for (std::size_t k = 0; k < colors.total(); ++k) {
    float total = 0;
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      const float color = colors.ptr<float>()[c];
      total += std::max({0.0f, color - high.ptr<float>()[c], low.ptr<float>()[c] - color});
    }
    sum.ptr<float>()[k] = total;
  }
  return sum;
}

Side side_if_after(bool after) { return after ? Side::kAfter : Side::kBefore; }

/// Median of observed - rendered depth, m; 0 if there are hardly any.
double median_step_m(const Views& views, const cv::Mat& where) {
  return median_difference_m(image_of(views.observed_depth, views.camera),
                             image_of(views.rendered_depth, views.camera), where);
}

/// The surface that is nearer than its surroundings has the object.
std::optional<Side> side_by_depth(const Views& views, const cv::Mat& region, double min_step_m) {
  const double own_m = median_step_m(views, region);
  // The rest of an object with depth lies between that and its surroundings.
  if (std::abs(own_m) > kMaxFlatHeight_m) return side_if_after(own_m < 0);
  const double step_m = own_m - median_step_m(views, ring(region, kOutline_px, kDepthRing_px));
  if (std::abs(step_m) > min_step_m) return side_if_after(step_m < 0);
  return std::nullopt;
}

/// The image with the colours that are not around in the other one has the object.
std::optional<Side> side_by_colors(const ColorChange& colors, const cv::Mat& region) {
  const double observed = cv::mean(colors.observed, region)[0];
  const double rendered = cv::mean(colors.rendered, region)[0];
  if (std::max(observed, rendered) > kMinColorRatio * std::min(observed, rendered)) {
    return side_if_after(observed > rendered);
  }
  return std::nullopt;
}

/// The image with the stronger outline has the object.
std::optional<Side> side_by_outline(const Views& views, const cv::Mat& region,
                                    double min_contrast) {
  cv::Mat inner;
  cv::erode(region, inner, disc(1));
  const cv::Mat outline = grow(region, 1) - inner;
  const auto contrast = [&](const float* rgb) {
    return cv::mean(gradient_magnitude(gray_of(image_of(rgb, views.camera, 3))), outline)[0];
  };
  const double observed = contrast(views.observed_rgb), rendered = contrast(views.rendered_rgb);
  if (std::abs(observed - rendered) < min_contrast) return std::nullopt;
  return side_if_after(observed > rendered);
}

}  // namespace

ColorChange compare_colors(const Views& views, const Masks& masks, int edge_tolerance_px) {
  const cv::Mat observed = image_of(views.observed_rgb, views.camera, 3);
  const cv::Mat rendered = image_of(views.rendered_rgb, views.camera, 3);
  ColorChange change{outside_range(observed, rendered, edge_tolerance_px),
                     outside_range(rendered, observed, edge_tolerance_px),
                     {}};
  const cv::Mat unknown = image_of(masks.known, views.camera) == 0;
  change.observed.setTo(0, unknown);
  change.rendered.setTo(0, unknown);
  change.larger = cv::max(change.observed, change.rendered);
  return change;
}

bool has_outline(const cv::Mat& color_change, const cv::Mat& region) {
  const cv::Mat around = ring(region, kOutline_px, kOutlineRing_px);
  return cv::mean(color_change, around)[0] < kMaxOutlineShare * cv::mean(color_change, region)[0];
}

std::optional<Side> side_of_flat(const Views& views, const ColorChange& colors,
                                 const cv::Mat& region, const ObjectRule& rule) {
  if (const auto side = side_by_depth(views, region, rule.min_flat_step_m)) return side;
  if (const auto side = side_by_colors(colors, region)) return side;
  return side_by_outline(views, region, rule.min_flat_contrast);
}

}  // namespace gslts::detect
