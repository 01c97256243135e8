#include "gslts/detect/regions.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "color_constancy.hpp"
#include "evidence.hpp"
#include "flat_change.hpp"
#include "images.hpp"
#include "logistic.hpp"
#include "segmentation.hpp"
#include "surface_of.hpp"

namespace gslts::detect {
namespace {

/// One image, and what the other one does not show of it.
struct Image {
  Side side;
  cv::Mat rgb;     ///< [H,W] of three floats.
  cv::Mat change;  ///< [H,W] float, see `ColorChange`.
};

/// Computes how much the hues of two images differ, summed over the channels: their difference
/// without that of the brightness.
cv::Mat chroma_change(const cv::Mat& rgb, const cv::Mat& other) {
  cv::Mat change(rgb.size(), CV_32F);
  for (std::size_t k = 0; k < rgb.total(); ++k) {
    const cv::Vec3f step = rgb.ptr<cv::Vec3f>()[k] - other.ptr<cv::Vec3f>()[k];
    const float mean = (step[0] + step[1] + step[2]) / 3;
    change.ptr<float>()[k] =
        std::abs(step[0] - mean) + std::abs(step[1] - mean) + std::abs(step[2] - mean);
  }
  return change;
}

/// Returns the image that is segmented: colours (CIELAB) and the colour change.
cv::Mat channels_of(const Image& image) {
  cv::Mat lab, blurred;
  cv::cvtColor(cv::max(cv::min(image.rgb, 1), 0), lab, cv::COLOR_RGB2Lab);
  cv::Mat channels(lab.size(), CV_32FC4);
  for (std::size_t k = 0; k < lab.total(); ++k) {
    const cv::Vec3f& color = lab.ptr<cv::Vec3f>()[k];
    channels.ptr<cv::Vec4f>()[k] = {color[0], kHueWeight * color[1], kHueWeight * color[2],
                                    kChangeWeight * std::min(1.0f, image.change.ptr<float>()[k])};
  }
  cv::GaussianBlur(channels, blurred, {}, kSegmentBlur_px, 0, cv::BORDER_REPLICATE);
  return blurred;
}

double log_mean(const cv::Mat& values, const cv::Mat& where) {
  return std::log(cv::mean(values, where)[0] + kTinyChange);
}

/// Logarithm of the difference of the mean colours of two regions of an image.
double log_contrast(const cv::Mat& rgb, const cv::Mat& region, const cv::Mat& around) {
  const cv::Scalar step = cv::mean(rgb, region) - cv::mean(rgb, around);
  return std::log(std::abs(step[0]) + std::abs(step[1]) + std::abs(step[2]) + kTinyChange);
}

/// @param other_rgb  The other image, with the same light.
RegionFeatures features_of(const Image& image, const cv::Mat& other_rgb, const cv::Mat& chroma,
                           const Pixels& pixels, const Camera& camera) {
  const cv::Rect box = box_of(pixels, camera), part = with_ring(box, camera);
  const cv::Mat region = mask_of(pixels, camera)(part).clone();
  cv::Mat around = ring(region, kRingStart_px, kRingEnd_px + 1);
  if (cv::countNonZero(around) == 0) around = region;
  const bool touches =
      box.x <= 1 || box.y <= 1 || box.br().x >= camera.width - 1 || box.br().y >= camera.height - 1;
  const double aspect = std::log(double(box.width) / box.height);
  const double focal_px = 0.5 * (camera.fx + camera.fy);
  return {
      log_mean(chroma(part), region),
      log_mean(chroma(part), around),
      std::min(0.0, log_mean(image.change(part), region)),
      log_contrast(other_rgb(part), region, around),
      std::log(thickness_px(region) / focal_px),
      touches ? 1.0 : 0.0,
      aspect * aspect,
      image.side == Side::kBefore ? 1.0 : 0.0,
  };
}

void add_regions(const Image& image, const cv::Mat& other_rgb, const Camera& camera, int min_px,
                 std::vector<Region>& regions) {
  const cv::Mat chroma = chroma_change(image.rgb, other_rgb);
  const std::vector<float> scales(kSegmentScales.begin(), kSegmentScales.end());
  for (std::vector<Pixels>& segments : segment_image(channels_of(image), scales, min_px)) {
    for (Pixels& pixels : segments) {
      if (int(pixels.size()) < min_px ||
          double(pixels.size()) > kMaxRegionShare * double(image.rgb.total())) {
        continue;
      }
      double sum = 0;
      for (const std::size_t k : pixels) sum += image.change.ptr<float>()[k];
      if (sum < kMinRegionChange * double(pixels.size())) continue;
      const RegionFeatures features = features_of(image, other_rgb, chroma, pixels, camera);
      regions.push_back({image.side, std::move(pixels), features});
    }
  }
}

/// Returns the depths of the frame, and those of the map where none were measured.
std::vector<float> filled_depths(const Views& views) {
  std::vector<float> depths(views.observed_depth, views.observed_depth + views.size());
  for (std::size_t k = 0; k < depths.size(); ++k) {
    if (!has_depth(depths[k])) depths[k] = views.rendered_depth[k];
  }
  return depths;
}

/// A region that may become a surface.
struct Candidate {
  const Region* region;
  double confidence;
  cv::Rect box;
};

/// Lists the regions that are likely enough, the most likely first.
std::vector<Candidate> likely_regions(const std::vector<Region>& regions, const Camera& camera,
                                      double min_confidence) {
  std::vector<Candidate> candidates;
  for (const Region& region : regions) {
    const double confidence = region_confidence(region.features);
    if (confidence < min_confidence) continue;
    candidates.push_back({&region, confidence, box_of(region.pixels, camera)});
  }
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const Candidate& a, const Candidate& b) { return a.confidence > b.confidence; });
  return candidates;
}

/// Tests whether two regions show one object: they share pixels, or one is the rim of the other.
bool are_same(const Candidate& a, const Candidate& b) {
  const double common_box = (a.box & b.box).area();
  if (common_box > kMaxBoxIou * (a.box.area() + b.box.area() - common_box)) return true;
  const Pixels &pixels = a.region->pixels, &others = b.region->pixels;
  Pixels common;
  std::set_intersection(pixels.begin(), pixels.end(), others.begin(), others.end(),
                        std::back_inserter(common));
  return double(common.size()) > kMaxOverlap * double(std::min(pixels.size(), others.size()));
}

}  // namespace

std::vector<Region> find_regions(const Views& views, const Masks& masks, const ObjectRule& rule) {
  gslts::validate(views.camera, "find_regions");
  validate(rule, "find_regions");
  const Camera& camera = views.camera;
  const cv::Mat observed = image_of(views.observed_rgb, camera, 3);
  const cv::Mat rendered =
      match_light(image_of(views.rendered_rgb, camera, 3), observed, image_of(masks.known, camera));
  Views lit = views;
  lit.rendered_rgb = rendered.ptr<float>();
  const ColorChange colors = compare_colors(lit, masks, rule.edge_tolerance_px);
  std::vector<Region> regions;
  add_regions({Side::kAfter, observed, colors.observed}, rendered, camera, rule.min_area_px,
              regions);
  add_regions({Side::kBefore, rendered, colors.rendered}, observed, camera, rule.min_area_px,
              regions);
  return regions;
}

double region_confidence(const RegionFeatures& features) {
  return logistic(kRegionOffset, kRegionWeights, features);
}

Surfaces find_changed_regions(const Views& views, const Masks& masks, const ObjectRule& rule) {
  const std::vector<Region> regions = find_regions(views, masks, rule);
  const std::vector<float> depths = filled_depths(views);
  Views filled = views;
  filled.observed_depth = depths.data();
  Surfaces result;
  result.labels = Array<std::int32_t>(views.size(), 0);
  std::vector<Candidate> taken;
  for (const Candidate& candidate :
       likely_regions(regions, views.camera, kMinEndConfidence * rule.min_confidence)) {
    const auto is_same = [&](const Candidate& other) { return are_same(candidate, other); };
    if (std::any_of(taken.begin(), taken.end(), is_same)) continue;
    const Region& region = *candidate.region;
    std::optional<Surface> surface = surface_of(filled, region.pixels, region.side);
    if (!surface || surface->area_m2 < rule.min_area_m2) continue;
    taken.push_back(candidate);
    surface->label = int(taken.size());
    surface->color_confidence = candidate.confidence;
    for (const std::size_t k : region.pixels) {
      if (result.labels[k] == 0) result.labels[k] = surface->label;
    }
    result.surfaces.push_back(*std::move(surface));
  }
  return result;
}

}  // namespace gslts::detect
