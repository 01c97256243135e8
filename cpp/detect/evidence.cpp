#include "evidence.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mat.hpp"

namespace gslts::detect {
namespace {

/// Around a surface is what is from 3 to 5 px beside it; what is nearer may be its edge.
constexpr int kBeside_px = 2, kAround_px = 5;

cv::Rect around(const Pixels& pixels, const Camera& camera) {
  int left = camera.width, top = camera.height, right = 0, bottom = 0;
  for (const std::size_t k : pixels) {
    const int x = int(k % std::size_t(camera.width)), y = int(k / std::size_t(camera.width));
    left = std::min(left, x), right = std::max(right, x + 1);
    top = std::min(top, y), bottom = std::max(bottom, y + 1);
  }
  constexpr int kMargin_px = kAround_px + 1;
  const cv::Rect image(0, 0, camera.width, camera.height);
  const cv::Point low(left - kMargin_px, top - kMargin_px);
  const cv::Point high(right + kMargin_px, bottom + kMargin_px);
  return cv::Rect(low, high) & image;
}

double diameter_px(const cv::Mat& region) {
  cv::Mat padded, distances;
  cv::copyMakeBorder(region, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::distanceTransform(padded, distances, cv::DIST_L2, cv::DIST_MASK_5);
  double most = 0;
  cv::minMaxLoc(distances, nullptr, &most);
  return 2 * most;
}

double sum_of_magnitudes(const cv::Scalar& color) {
  return std::abs(color[0]) + std::abs(color[1]) + std::abs(color[2]);
}

/// Mean difference of colours that are as bright on the whole.
double unexplained(const cv::Mat& photo, const cv::Mat& map, const cv::Mat& where) {
  constexpr double kDark = 0.02;  // In the dark the ratio of two colours tells nothing.
  const cv::Scalar here = cv::mean(photo, where), there = cv::mean(map, where);
  double log_gain = 0;
  for (int c = 0; c < 3; ++c) log_gain += std::log((here[c] + kDark) / (there[c] + kDark)) / 3;
  cv::Mat difference;
  cv::scaleAdd(map, -std::exp(log_gain), photo, difference);
  return sum_of_magnitudes(cv::mean(cv::abs(difference), where));
}

double correlation(const cv::Mat& photo, const cv::Mat& map, const cv::Mat& where) {
  cv::Mat one, other;
  cv::cvtColor(photo, one, cv::COLOR_RGB2GRAY);
  cv::cvtColor(map, other, cv::COLOR_RGB2GRAY);
  one -= cv::mean(one, where);
  other -= cv::mean(other, where);
  const double both = cv::mean(one.mul(other), where)[0];
  const double squares = cv::mean(one.mul(one), where)[0] * cv::mean(other.mul(other), where)[0];
  constexpr double kNone = 1e-12;
  return both / std::sqrt(squares + kNone);
}

double median_difference_m(const cv::Mat& measured, const cv::Mat& rendered, const cv::Mat& where) {
  constexpr std::size_t kLeast = 5;
  std::vector<float> differences;
  for (int y = 0; y < where.rows; ++y) {
    for (int x = 0; x < where.cols; ++x) {
      const float here = measured.at<float>(y, x), there = rendered.at<float>(y, x);
      const bool both = here > 0 && std::isfinite(here) && there > 0;
      if (both && where.at<std::uint8_t>(y, x)) differences.push_back(std::abs(here - there));
    }
  }
  if (differences.size() < kLeast) return 0;
  const auto middle = differences.begin() + std::ptrdiff_t(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return *middle;
}

/// Share of the pixels beside a region whose depth goes on from the nearest of its pixels; a half
/// if hardly any can tell.
double attached(const cv::Mat& depth, const cv::Mat& region) {
  constexpr int kFrom_px = 1, kTo_px = 4;
  constexpr double kStep_m = 0.01, kStepShare = 0.01;  // Of the depth.
  constexpr int kLeast = 4;
  const cv::Mat beside = grown(region, kTo_px) - grown(region, kFrom_px);
  cv::Mat distances, nearest;
  cv::distanceTransform(region == 0, distances, nearest, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<float> own(std::size_t(region.total()) + 1);  // By the label of the pixel.
  for (int y = 0; y < region.rows; ++y) {
    for (int x = 0; x < region.cols; ++x) {
      if (region.at<std::uint8_t>(y, x)) {
        own[std::size_t(nearest.at<int>(y, x))] = depth.at<float>(y, x);
      }
    }
  }
  int known = 0, going_on = 0;
  for (int y = 0; y < region.rows; ++y) {
    for (int x = 0; x < region.cols; ++x) {
      if (!beside.at<std::uint8_t>(y, x)) continue;
      const double here = depth.at<float>(y, x);
      const double there = own[std::size_t(nearest.at<int>(y, x))];
      if (!(here > 0 && std::isfinite(here) && there > 0 && std::isfinite(there))) continue;
      ++known;
      going_on += std::abs(here - there) < kStep_m + kStepShare * there;
    }
  }
  return known < kLeast ? 0.5 : double(going_on) / double(known);
}

}  // namespace

Evidence evidence_of(const Views& views, const Masks& masks, const Pixels& pixels,
                     const Surface& surface) {
  const Camera& camera = views.camera;
  const cv::Rect part = around(pixels, camera);
  const cv::Mat photo = image_of(views.photo, camera, 3)(part);
  const cv::Mat map = image_of(views.rgb, camera, 3)(part);
  const cv::Mat measured = image_of(views.measured, camera)(part);
  const cv::Mat rendered = image_of(views.rendered, camera)(part);
  cv::Mat region = cv::Mat::zeros(part.size(), CV_8U);
  for (const std::size_t k : pixels) {
    const int x = int(k % std::size_t(camera.width)), y = int(k / std::size_t(camera.width));
    region.at<std::uint8_t>(y - part.y, x - part.x) = 255;
  }
  const cv::Mat beside = grown(region, kBeside_px);
  cv::Mat ring = grown(region, kAround_px) - beside;
  ring.setTo(0, mask_of(masks.known, camera)(part) == 0);

  constexpr double kLeastColor = 0.05;  // A share of less tells nothing.
  const cv::Mat difference = photo - map;
  const double within = sum_of_magnitudes(cv::mean(difference, region));
  const double without = sum_of_magnitudes(cv::mean(difference, ring));
  Evidence evidence;
  evidence.thickness_m = diameter_px(region) * surface.depth_m / (0.5 * (camera.fx + camera.fy));
  evidence.attached = attached(surface.side == Side::kAfter ? measured : rendered, region);
  evidence.unexplained = unexplained(photo, map, region);
  evidence.correlation = correlation(photo, map, beside);
  evidence.around_m = median_difference_m(measured, rendered, ring);
  evidence.around_color = without / (within + kLeastColor);
  return evidence;
}

}  // namespace gslts::detect
