#include "depth_change.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "images.hpp"

namespace gslts::detect {
namespace {

/// Depth of pixels without one.
constexpr float kFar_m = std::numeric_limits<float>::max();

/// Copies depths; pixels without one are far away.
cv::Mat fill_far(const float* depth, const Camera& camera) {
  cv::Mat image(camera.height, camera.width, CV_32F);
  float* pixel = image.ptr<float>();
  for (std::size_t k = 0; k < image.total(); ++k) {
    pixel[k] = has_depth(depth[k]) ? depth[k] : kFar_m;
  }
  return image;
}

cv::Mat nearest_around(const cv::Mat& depth, int radius_px) {
  cv::Mat nearest;
  cv::erode(depth, nearest, square(radius_px));
  return nearest;
}

/// Opens the mask of certain pixels, and adds the likely ones that the search within
/// `edge_tolerance_px` took from around them.
Array<std::uint8_t> add_likely(const cv::Mat& certain, const cv::Mat& likely, int tolerance_px) {
  cv::Mat mask;
  cv::morphologyEx(certain, mask, cv::MORPH_OPEN, disc(1));
  cv::dilate(mask, mask, square(tolerance_px + 1));
  cv::bitwise_and(mask, likely, mask);
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, disc(1));
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc(1));
  return array_of(mask);
}

/// Depth differences in units of the smallest that counts.
class Steps {
 public:
  Steps(const Views& views, const Masks& masks, const cv::Mat& rendered_depth,
        const ObjectRule& rule)
      : rule_(rule),
        noise_(views.noise),
        focal_px_(0.5 * (views.camera.fx + views.camera.fy)),
        slope_(surface_slope(rendered_depth)),
        known_(image_of(masks.known, views.camera)) {}

  /// Computes how much nearer one image of depths is than another; 0 where either is unknown.
  cv::Mat between(const cv::Mat& depth, const cv::Mat& other) const {
    cv::Mat steps(depth.size(), CV_32F);
    for (std::size_t k = 0; k < depth.total(); ++k) {
      const float here = depth.ptr<float>()[k], there = other.ptr<float>()[k];
      const bool both = known_.ptr<std::uint8_t>()[k] && here < kFar_m && there < kFar_m;
      const double step = both ? (there - here) / min_step_m(here, k) : 0;
      steps.ptr<float>()[k] = float(std::clamp(step, -kMaxSteps, kMaxSteps));
    }
    return steps;
  }

  /// Finds what only one image of depths shows.
  Array<std::uint8_t> only_in(const cv::Mat& depth, const cv::Mat& other) const {
    const int tolerance_px = rule_.edge_tolerance_px;
    const cv::Mat certain = between(depth, nearest_around(other, tolerance_px)) > 1;
    return add_likely(certain, between(depth, other) > kMinJoinedStep, tolerance_px);
  }

 private:
  double min_step_m(float depth, std::size_t k) const {
    const double slope_m = slope_.ptr<float>()[k];
    const double tangent = focal_px_ * slope_m / depth;  // Of the angle to the image plane.
    const double noise_m =
        noise_.constant_m * std::sqrt(1 + tangent * tangent) + noise_.per_m * depth * depth;
    return rule_.step_sigmas * noise_m + rule_.step_px * slope_m;
  }

  const ObjectRule& rule_;
  DepthNoise noise_;
  double focal_px_;
  cv::Mat slope_, known_;
};

}  // namespace

cv::Mat surface_slope(const cv::Mat& depth) {
  cv::Mat slope = gradient_magnitude(depth);
  cv::erode(slope, slope, square(kSlopeWindow_px / 2));
  return cv::min(slope, kMaxSlope * depth);
}

DepthChange compare_depths(const Views& views, const Masks& masks, const ObjectRule& rule) {
  const cv::Mat observed = fill_far(views.observed_depth, views.camera);
  const cv::Mat rendered = fill_far(views.rendered_depth, views.camera);
  const Steps steps(views, masks, rendered, rule);
  DepthChange change{steps.only_in(observed, rendered), steps.only_in(rendered, observed),
                     Array<float>(views.size())};
  const cv::Mat differences = cv::abs(steps.between(observed, rendered));
  std::copy_n(differences.ptr<float>(), views.size(), change.steps.begin());
  return change;
}

}  // namespace gslts::detect
