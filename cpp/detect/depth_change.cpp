#include "depth_change.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "mat.hpp"

namespace gslts::detect {
namespace {

constexpr float kFar_m = std::numeric_limits<float>::max();

/// Depths, with what was not measured far away.
cv::Mat filled(const float* depth, const Camera& camera) {
  cv::Mat image(camera.height, camera.width, CV_32F);
  float* pixel = image.ptr<float>();
  for (std::size_t k = 0; k < image.total(); ++k) {
    pixel[k] = depth[k] > 0 && std::isfinite(depth[k]) ? depth[k] : kFar_m;
  }
  return image;
}

cv::Mat nearest_around(const cv::Mat& depth, int reach_px) {
  const int side = 2 * reach_px + 1;
  cv::Mat nearest;
  cv::erode(depth, nearest, cv::Mat::ones(side, side, CV_8U));
  return nearest;
}

/// How much the depth changes from pixel to pixel of a surface, m; an edge is thin.
cv::Mat slope_of(const cv::Mat& depth) {
  constexpr double kPerPixel = 1.0 / 8;  // Sobel's 3 x 3 kernel sums eight differences of a pixel.
  constexpr float kSteepest = 0.05f;     // Of the depth.
  constexpr int kWide_px = 7;            // Wider than an edge.
  cv::Mat along_x, along_y, slope;
  cv::Sobel(depth, along_x, CV_32F, 1, 0, 3, kPerPixel);
  cv::Sobel(depth, along_y, CV_32F, 0, 1, 3, kPerPixel);
  cv::magnitude(along_x, along_y, slope);
  cv::erode(slope, slope, cv::Mat::ones(kWide_px, kWide_px, CV_8U));
  return cv::min(slope, kSteepest * depth);
}

/// Certain pixels, without specks, and those likely ones that `reach_px` took from around them.
Array<std::uint8_t> completed(const cv::Mat& certain, const cv::Mat& likely, int reach_px) {
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  cv::Mat mask;
  cv::morphologyEx(certain, mask, cv::MORPH_OPEN, disc);
  const int side = 2 * (reach_px + 1) + 1;
  cv::dilate(mask, mask, cv::Mat::ones(side, side, CV_8U));
  cv::bitwise_and(mask, likely, mask);
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, disc);
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc);
  return array_of(mask);
}

}  // namespace

DepthChange depth_change_of(const Views& views, const Masks& masks, const ObjectRule& rule) {
  const cv::Mat seen = filled(views.measured, views.camera);
  const cv::Mat known = filled(views.rendered, views.camera);
  const cv::Mat slope = slope_of(known);
  const cv::Mat usable = mask_of(masks.known, views.camera);
  const double focal_px = 0.5 * (views.camera.fx + views.camera.fy);
  // The least step that counts, for a surface at some depth.
  const auto least_m = [&](float depth, std::size_t k) {
    const double change = slope.ptr<float>()[k];  // Of the depth, from pixel to pixel.
    const double tangent = focal_px * change / depth;
    return rule.step_m * std::sqrt(1 + tangent * tangent) + rule.step_per_m * depth * depth +
           rule.step_px * change;
  };
  // How much nearer one depth is than another, in such steps.
  const auto steps = [&](const cv::Mat& one, const cv::Mat& other) {
    cv::Mat image(one.size(), CV_32F);
    for (std::size_t k = 0; k < views.size(); ++k) {
      const float here = one.ptr<float>()[k], there = other.ptr<float>()[k];
      const bool both = usable.ptr<std::uint8_t>()[k] && here < kFar_m && there < kFar_m;
      image.ptr<float>()[k] = both ? float((there - here) / least_m(here, k)) : 0;
    }
    return image;
  };
  constexpr double kLikely = 0.5;
  const auto only_in = [&](const cv::Mat& one, const cv::Mat& other) {
    const cv::Mat certain = steps(one, nearest_around(other, rule.reach_px)) > 1;
    return completed(certain, steps(one, other) > kLikely, rule.reach_px);
  };
  DepthChange change{only_in(seen, known), only_in(known, seen), Array<float>(views.size())};
  const cv::Mat differences = cv::abs(steps(seen, known));
  std::copy_n(differences.ptr<float>(), views.size(), change.steps.begin());
  return change;
}

}  // namespace gslts::detect
