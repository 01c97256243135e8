#include "evidence.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace gslts::detect {
namespace {

double sum_of_magnitudes(const cv::Scalar& color) {
  return std::abs(color[0]) + std::abs(color[1]) + std::abs(color[2]);
}

/// Mean difference of the colours after the rendering got the gain that makes both as bright.
double residual_color(const cv::Mat& observed, const cv::Mat& rendered, const cv::Mat& where) {
  const cv::Scalar here = cv::mean(observed, where), there = cv::mean(rendered, where);
  double log_gain = 0;
  for (int c = 0; c < 3; ++c) log_gain += std::log((here[c] + kDark) / (there[c] + kDark)) / 3;
  cv::Mat difference;
  cv::scaleAdd(rendered, -std::exp(log_gain), observed, difference);
  return sum_of_magnitudes(cv::mean(cv::abs(difference), where));
}

/// Colour change in a ring, as a share of that in the region.
double ring_color_ratio(const cv::Mat& observed, const cv::Mat& rendered, const cv::Mat& region,
                        const cv::Mat& ring) {
  const cv::Mat difference = observed - rendered;
  const double within = sum_of_magnitudes(cv::mean(difference, region));
  const double around = sum_of_magnitudes(cv::mean(difference, ring));
  return around / (within + kMinColorChange);
}

/// Correlation of the brightness of both images.
double correlation(const cv::Mat& observed, const cv::Mat& rendered, const cv::Mat& where) {
  cv::Mat a = gray_of(observed), b = gray_of(rendered);
  a -= cv::mean(a, where);
  b -= cv::mean(b, where);
  const double covariance = cv::mean(a.mul(b), where)[0];
  const double variances = cv::mean(a.mul(a), where)[0] * cv::mean(b.mul(b), where)[0];
  return covariance / std::sqrt(variances + kTinyVariance);
}

/// Median absolute difference of depths, m; 0 if there are hardly any.
double median_magnitude_m(const cv::Mat& observed, const cv::Mat& rendered, const cv::Mat& where) {
  std::vector<float> differences = depth_differences(observed, rendered, where);
  if (differences.size() < kMinDepthPixels) return 0;
  for (float& difference : differences) difference = std::abs(difference);
  return median(differences);
}

/// For each pixel, the depth of the nearest pixel of a region.
cv::Mat depth_of_nearest(const cv::Mat& depth, const cv::Mat& region) {
  cv::Mat distances, nearest;
  cv::distanceTransform(region == 0, distances, nearest, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<float> by_label(std::size_t(region.total()) + 1);
  for (int y = 0; y < region.rows; ++y) {
    for (int x = 0; x < region.cols; ++x) {
      if (!region.at<std::uint8_t>(y, x)) continue;
      by_label[std::size_t(nearest.at<int>(y, x))] = depth.at<float>(y, x);
    }
  }
  cv::Mat result(depth.size(), CV_32F);
  for (int y = 0; y < region.rows; ++y) {
    for (int x = 0; x < region.cols; ++x) {
      result.at<float>(y, x) = by_label[std::size_t(nearest.at<int>(y, x))];
    }
  }
  return result;
}

/// Share of the pixels beside a region in which the depth of its nearest pixel continues.
double attached_share(const cv::Mat& depth, const cv::Mat& region) {
  const cv::Mat beside = ring(region, kAttachedStart_px, kAttachedEnd_px);
  const cv::Mat own = depth_of_nearest(depth, region);
  int known = 0, attached = 0;
  for (int y = 0; y < region.rows; ++y) {
    for (int x = 0; x < region.cols; ++x) {
      const float here = depth.at<float>(y, x), there = own.at<float>(y, x);
      if (!beside.at<std::uint8_t>(y, x) || !has_depth(here) || !has_depth(there)) continue;
      ++known;
      const double max_step_m = kAttachedStep_m + kAttachedStepShare * double(there);
      attached += std::abs(double(here) - double(there)) < max_step_m;
    }
  }
  return known < kMinAttachedPixels ? kUnknownAttached : double(attached) / double(known);
}

}  // namespace

cv::Rect with_ring(const cv::Rect& box, const Camera& camera) {
  constexpr int kMargin_px = kRingEnd_px + 1;
  const cv::Point margin(kMargin_px, kMargin_px);
  return cv::Rect(box.tl() - margin, box.br() + margin) &
         cv::Rect(0, 0, camera.width, camera.height);
}

double thickness_px(const cv::Mat& region) {
  cv::Mat padded, distances;
  cv::copyMakeBorder(region, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::distanceTransform(padded, distances, cv::DIST_L2, cv::DIST_MASK_5);
  double radius = 0;
  cv::minMaxLoc(distances, nullptr, &radius);
  return 2 * radius;
}

Evidence evidence_of(const Views& views, const Masks& masks, const Pixels& pixels,
                     const Surface& surface) {
  const Camera& camera = views.camera;
  const cv::Rect part = with_ring(box_of(pixels, camera), camera);
  const cv::Mat observed_rgb = image_of(views.observed_rgb, camera, 3)(part);
  const cv::Mat rendered_rgb = image_of(views.rendered_rgb, camera, 3)(part);
  const cv::Mat observed_depth = image_of(views.observed_depth, camera)(part);
  const cv::Mat rendered_depth = image_of(views.rendered_depth, camera)(part);
  const cv::Mat region = mask_of(pixels, camera)(part).clone();
  cv::Mat around = ring(region, kRingStart_px, kRingEnd_px);
  around.setTo(0, image_of(masks.known, camera)(part) == 0);
  Evidence evidence;
  evidence.thickness_m = thickness_px(region) * surface.depth_m / (0.5 * (camera.fx + camera.fy));
  evidence.attached_share =
      attached_share(surface.side == Side::kAfter ? observed_depth : rendered_depth, region);
  evidence.residual_color = residual_color(observed_rgb, rendered_rgb, region);
  evidence.correlation = correlation(observed_rgb, rendered_rgb, grow(region, kRingStart_px));
  evidence.ring_depth_m = median_magnitude_m(observed_depth, rendered_depth, around);
  if (views.depth_error != nullptr) {
    evidence.depth_error_m = cv::mean(image_of(views.depth_error, camera)(part), region)[0];
  }
  if (views.color_error != nullptr) {
    evidence.color_error = cv::mean(image_of(views.color_error, camera)(part), region)[0];
  }
  evidence.ring_color_ratio = ring_color_ratio(observed_rgb, rendered_rgb, region, around);
  return evidence;
}

}  // namespace gslts::detect
