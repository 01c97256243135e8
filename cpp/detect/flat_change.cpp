#include "flat_change.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mat.hpp"

namespace gslts::detect {
namespace {

/// Median of measured - rendered depth where both are, m; 0 if there are hardly any.
double median_difference(const Views& views, const cv::Mat& where) {
  constexpr std::size_t kLeast = 5;
  std::vector<float> differences;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!where.ptr<std::uint8_t>()[k]) continue;
    const float measured = views.measured[k], rendered = views.rendered[k];
    if (measured > 0 && std::isfinite(measured) && rendered > 0) {
      differences.push_back(measured - rendered);
    }
  }
  if (differences.size() < kLeast) return 0;
  const auto middle = differences.begin() + std::ptrdiff_t(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return *middle;
}

/// Mean change of the brightness a pixel, there.
double contrast(const float* rgb, const Camera& camera, const cv::Mat& where) {
  cv::Mat grey, along_x, along_y, strength;
  cv::cvtColor(image_of(rgb, camera, 3), grey, cv::COLOR_RGB2GRAY);
  constexpr double kPerPixel = 1.0 / 8;  // Sobel's 3 x 3 kernel sums eight differences of a pixel.
  cv::Sobel(grey, along_x, CV_32F, 1, 0, 3, kPerPixel);
  cv::Sobel(grey, along_y, CV_32F, 0, 1, 3, kPerPixel);
  cv::magnitude(along_x, along_y, strength);
  return cv::mean(strength, where)[0];
}

/// How far colours are beyond those of another image around them, summed over the channels.
cv::Mat beyond(const cv::Mat& colors, const cv::Mat& other, int reach_px) {
  const int side = 2 * reach_px + 1;
  const cv::Mat window = cv::Mat::ones(side, side, CV_8U);
  cv::Mat least, most;
  cv::erode(other, least, window);
  cv::dilate(other, most, window);
  cv::Mat sum(colors.size(), CV_32F);
  for (std::size_t k = 0; k < colors.total(); ++k) {
    float total = 0;
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      const float color = colors.ptr<float>()[c];
      total += std::max({0.0f, color - most.ptr<float>()[c], least.ptr<float>()[c] - color});
    }
    sum.ptr<float>()[k] = total;
  }
  return sum;
}

}  // namespace

Foreign foreign_colors(const Views& views, const Masks& masks, int reach_px) {
  const cv::Mat photo = image_of(views.photo, views.camera, 3);
  const cv::Mat map = image_of(views.rgb, views.camera, 3);
  Foreign foreign{beyond(photo, map, reach_px), beyond(map, photo, reach_px)};
  const cv::Mat unknown = mask_of(masks.known, views.camera) == 0;
  foreign.in_photo.setTo(0, unknown);
  foreign.in_map.setTo(0, unknown);
  return foreign;
}

bool has_outline(const cv::Mat& most, const cv::Mat& region) {
  constexpr double kFall = 0.5;
  constexpr int kOutside_px = 4;
  const cv::Mat ring = grown(region, kOutside_px) - grown(region, 2);
  return cv::mean(most, ring)[0] < kFall * cv::mean(most, region)[0];
}

std::optional<Side> side_of_flat(const Views& views, const Foreign& foreign, const cv::Mat& region,
                                 const ObjectRule& rule) {
  constexpr double kDeep_m = 0.1;  // No flat thing is so high.
  constexpr double kUneven =
      1.3;  // So many times as foreign to the other image, it is in this one.
  constexpr int kRing_px = 6;
  const cv::Mat edge = grown(region, 1);
  const cv::Mat ring = grown(region, kRing_px) - grown(region, 2);
  // What is left over of a thing with depth lies between that and what is around it.
  const double own_m = median_difference(views, region);
  if (std::abs(own_m) > kDeep_m) return own_m < 0 ? Side::kAfter : Side::kBefore;
  const double step_m = own_m - median_difference(views, ring);
  if (std::abs(step_m) > rule.flat_step_m) return step_m < 0 ? Side::kAfter : Side::kBefore;
  const double photo = cv::mean(foreign.in_photo, region)[0];
  const double map = cv::mean(foreign.in_map, region)[0];
  if (std::max(photo, map) > kUneven * std::min(photo, map)) {
    return photo > map ? Side::kAfter : Side::kBefore;
  }
  cv::Mat inner;
  cv::erode(region, inner, cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3}));
  const cv::Mat outline = edge - inner;
  const double in_photo = contrast(views.photo, views.camera, outline);
  const double in_map = contrast(views.rgb, views.camera, outline);
  if (std::abs(in_photo - in_map) < rule.least_contrast) return std::nullopt;
  return in_photo > in_map ? Side::kAfter : Side::kBefore;
}

}  // namespace gslts::detect
