#include "gslts/detect/regions.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "color_constancy.hpp"
#include "evidence.hpp"
#include "flat_change.hpp"
#include "gslts/detect/components.hpp"
#include "images.hpp"
#include "logistic.hpp"
#include "segmentation.hpp"
#include "surface_of.hpp"

namespace gslts::detect {
namespace {

/// One image, and what the other one does not show of it.
struct Image {
  Side side;
  cv::Mat rgb;       ///< [H,W] of three floats.
  cv::Mat lab;       ///< [H,W] of three floats, CIELAB.
  cv::Mat change;    ///< [H,W] float, see `ColorChange`.
  cv::Mat nearer_m;  ///< [H,W] float, by how much it is nearer than the other; 0 where unknown.
};

cv::Mat lab_of(const cv::Mat& rgb) {
  cv::Mat lab;
  cv::cvtColor(cv::max(cv::min(rgb, 1), 0), lab, cv::COLOR_RGB2Lab);
  return lab;
}

/// Computes by how much the frame is nearer than the rendering, averaged over a few pixels, m; 0
/// where it is not known.
cv::Mat nearer_than_map_m(const Views& views, const cv::Mat& known) {
  cv::Mat steps(known.size(), CV_32F, cv::Scalar(0)), weights = steps.clone();
  for (std::size_t k = 0; k < views.size(); ++k) {
    const float observed = views.observed_depth[k], rendered = views.rendered_depth[k];
    if (!known.ptr<std::uint8_t>()[k] || !has_depth(observed) || !has_depth(rendered)) continue;
    steps.ptr<float>()[k] = std::clamp(rendered - observed, -kMaxStep_m, kMaxStep_m);
    weights.ptr<float>()[k] = 1;
  }
  const cv::Mat unknown = weights == 0;
  cv::boxFilter(steps, steps, -1, {kStepWindow_px, kStepWindow_px});
  cv::boxFilter(weights, weights, -1, {kStepWindow_px, kStepWindow_px});
  steps /= weights;
  steps.setTo(0, unknown);
  return steps;
}

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
  cv::Mat channels(image.lab.size(), CV_32FC4), blurred;
  for (std::size_t k = 0; k < channels.total(); ++k) {
    const cv::Vec3f& color = image.lab.ptr<cv::Vec3f>()[k];
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
double log_contrast(const cv::Mat& colors, const cv::Mat& region, const cv::Mat& around,
                    double floor) {
  return std::log(cv::norm(cv::mean(colors, region) - cv::mean(colors, around)) + floor);
}

/// @param views  With the light of the frame in the rendering.
RegionFeatures features_of(const Image& image, const Image& other, const cv::Mat& chroma,
                           const Pixels& pixels, const Views& views) {
  const Camera& camera = views.camera;
  const cv::Rect box = box_of(pixels, camera), part = with_ring(box, camera);
  const cv::Mat region = mask_of(pixels, camera)(part).clone();
  cv::Mat around = ring(region, kRingStart_px, kRingEnd_px + 1);
  if (cv::countNonZero(around) == 0) around = region;
  const double aspect = std::log(double(box.width) / box.height);
  const double focal_px = 0.5 * (camera.fx + camera.fy);
  const double step_m = median_difference_m(image_of(views.rendered_depth, camera)(part),
                                            image_of(views.observed_depth, camera)(part), region);
  const bool before = image.side == Side::kBefore;
  return {
      log_mean(chroma(part), region),
      log_mean(chroma(part), around),
      std::min(0.0, log_mean(image.change(part), region)),
      log_contrast(other.rgb(part), region, around, kTinyChange),
      log_contrast(other.lab(part), region, around, kTinyContrast),
      std::log(thickness_px(region) / focal_px),
      aspect * aspect,
      std::clamp(before ? -step_m : step_m, -kFullStep_m, kFullStep_m),
      before ? 1.0 : 0.0,
  };
}

/// Lists the parts of an image that are nearer than the other one by each of `kRegionSteps_m`.
std::vector<Pixels> nearer_parts(const cv::Mat& nearer_m) {
  std::vector<Pixels> result;
  for (const float step_m : kRegionSteps_m) {
    const cv::Mat mask = nearer_m > step_m;
    const Components found = connected_components(mask.ptr(), mask.cols, mask.rows);
    std::vector<Pixels> parts(found.components.size() + 1);  // By label; 0 is no part.
    for (std::size_t k = 0; k < mask.total(); ++k) {
      if (found.labels[k] != 0) parts[std::size_t(found.labels[k])].push_back(k);
    }
    std::move(parts.begin() + 1, parts.end(), std::back_inserter(result));
  }
  return result;
}

void add_regions(const Image& image, const Image& other, const Views& views, int min_px,
                 std::vector<Region>& regions) {
  const cv::Mat chroma = chroma_change(image.rgb, other.rgb);
  const std::vector<float> scales(kSegmentScales.begin(), kSegmentScales.end());
  std::vector<std::vector<Pixels>> parts = segment_image(channels_of(image), scales, min_px);
  parts.push_back(nearer_parts(image.nearer_m));
  for (std::vector<Pixels>& kind : parts) {
    for (Pixels& pixels : kind) {
      if (int(pixels.size()) < min_px ||
          double(pixels.size()) > kMaxRegionShare * double(image.rgb.total())) {
        continue;
      }
      double sum = 0;
      for (const std::size_t k : pixels) sum += image.change.ptr<float>()[k];
      if (sum < kMinRegionChange * double(pixels.size())) continue;
      const RegionFeatures features = features_of(image, other, chroma, pixels, views);
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
  const cv::Mat nearer_m = nearer_than_map_m(views, image_of(masks.known, camera));
  const Image frame{Side::kAfter, observed, lab_of(observed), colors.observed, nearer_m};
  const Image map{Side::kBefore, rendered, lab_of(rendered), colors.rendered, -nearer_m};
  std::vector<Region> regions;
  add_regions(frame, map, lit, rule.min_area_px, regions);
  add_regions(map, frame, lit, rule.min_area_px, regions);
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
