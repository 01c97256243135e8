#include "depth_change.hpp"

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

void clean(Array<std::uint8_t>& mask, const Camera& camera) {
  const cv::Mat image = mask_of(mask, camera);
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  cv::morphologyEx(image, image, cv::MORPH_OPEN, disc);
  cv::morphologyEx(image, image, cv::MORPH_CLOSE, disc, {-1, -1}, 2);
}

}  // namespace

DepthChange depth_change_of(const Views& views, const Masks& masks, const ObjectRule& rule) {
  const cv::Mat seen = filled(views.measured, views.camera);
  const cv::Mat known = filled(views.rendered, views.camera);
  const cv::Mat seen_around = nearest_around(seen, rule.reach_px);
  const cv::Mat known_around = nearest_around(known, rule.reach_px);
  // The depth of a map is that of the centres of its Gaussians, which errs where they are large and
  // the surface slants.
  const cv::Mat slope = slope_of(known);
  const auto nearer = [&](std::size_t k, float depth, float around) {
    const double step_m = rule.step_m + rule.step_per_m * depth * depth +
                          rule.step_px * slope.ptr<float>()[k];
    return around < kFar_m && around - depth > step_m;
  };
  DepthChange change{Array<std::uint8_t>(views.size()), Array<std::uint8_t>(views.size())};
  for (std::size_t k = 0; k < views.size(); ++k) {
    const float here = seen.ptr<float>()[k], there = known.ptr<float>()[k];
    const bool both = masks.known[k] && here < kFar_m && there < kFar_m;
    change.appeared[k] = both && nearer(k, here, known_around.ptr<float>()[k]);
    change.vanished[k] = both && nearer(k, there, seen_around.ptr<float>()[k]);
  }
  clean(change.appeared, views.camera);
  clean(change.vanished, views.camera);
  return change;
}

}  // namespace gslts::detect
