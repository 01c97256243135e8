#include "gslts/detect/objects.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "depth_change.hpp"
#include "flat_change.hpp"
#include "gslts/detect/components.hpp"
#include "mat.hpp"
#include "rules.hpp"
#include "surface.hpp"

namespace gslts::detect {
namespace {

/// A difference of sRGB colours by which two surfaces look half alike.
constexpr double kColorStep = 0.2;
/// Of a difference in brightness, which light and shade change from place to place.
constexpr double kBrightnessShare = 0.5;
/// Parts so near to each other are of one object: bars of a chair, say.
constexpr int kGap_px = 3;
/// Around an object that moved, colours differ for its shadow and for edges a little off.
constexpr int kShadow_px = 4;

void validate_rule(const ObjectRule& rule, const char* function) {
  require_in(function, "step_m", rule.step_m, 0, 10);
  require_in(function, "step_per_m", rule.step_per_m, 0, 10);
  require_in(function, "step_px", rule.step_px, 0, 100);
  require_in(function, "reach_px", rule.reach_px, 0, 100);
  require_in(function, "least_area_m2", rule.least_area_m2, 0, 100);
  require_in(function, "least_area_px", rule.least_area_px, 1, 1e9);
  require_in(function, "flat_area_m2", rule.flat_area_m2, 0, 100);
  require_in(function, "flat_step_m", rule.flat_step_m, 0, 10);
  require_in(function, "least_contrast", rule.least_contrast, 0, 10);
  require_in(function, "alike", rule.alike, 0, 1);
}

Pixels pixels_of(const Components& components, const Component& one, int width) {
  Pixels pixels;
  pixels.reserve(std::size_t(one.area));
  for (int row = one.y; row < one.y + one.height; ++row) {
    for (int column = one.x; column < one.x + one.width; ++column) {
      const std::size_t k = std::size_t(row) * width + column;
      if (components.labels[k] == one.label) pixels.push_back(k);
    }
  }
  return pixels;
}

double median_of(const Array<float>& values, const Pixels& pixels) {
  std::vector<float> chosen;
  for (const std::size_t k : pixels) chosen.push_back(values[k]);
  const auto middle = chosen.begin() + std::ptrdiff_t(chosen.size() / 2);
  std::nth_element(chosen.begin(), middle, chosen.end());
  return *middle;
}

/// Finds surfaces, and draws each into the image of labels with the next free number.
class Finder {
 public:
  Finder(const Views& views, const Masks& masks, const ObjectRule& rule)
      : views_(views),
        masks_(masks),
        rule_(rule),
        depth_(depth_change_of(views, masks, rule)),
        labels_(views.size(), 0) {}

  void add_steps() {
    add_steps(depth_.appeared, Side::kAfter);
    add_steps(depth_.vanished, Side::kBefore);
  }

  /// What colours and features tell beside that.
  void add_flats() {
    cv::Mat rest = mask_of(masks_.combined, views_.camera).clone();
    rest.setTo(0, around_found());
    const int width = views_.camera.width;
    const Components parts =
        components_of(rest.ptr<std::uint8_t>(), width, views_.camera.height);
    for (const Component& part : parts.components) {
      if (part.area < rule_.least_area_px) break;
      Pixels pixels = pixels_of(parts, part, width);
      cv::Mat region = cv::Mat::zeros(views_.camera.height, width, CV_8U);
      for (const std::size_t k : pixels) region.ptr<std::uint8_t>()[k] = 255;
      const std::optional<Side> side = side_of_flat(views_, region, rule_);
      if (side) add(pixels, *side, rule_.flat_area_m2, true);
    }
  }

  std::vector<Surface> found;

  Array<std::int32_t> labels() && { return std::move(labels_); }

 private:
  void add_steps(const Array<std::uint8_t>& mask, Side side) {
    const int width = views_.camera.width;
    cv::Mat together;
    cv::dilate(mask_of(mask, views_.camera), together, cv::Mat::ones(kGap_px, kGap_px, CV_8U));
    const Components parts =
        components_of(together.ptr<std::uint8_t>(), width, views_.camera.height);
    for (const Component& part : parts.components) {
      if (part.area < rule_.least_area_px) break;  // The largest come first.
      Pixels pixels = pixels_of(parts, part, width);
      pixels.erase(std::remove_if(pixels.begin(), pixels.end(),
                                  [&](std::size_t k) { return mask[k] == 0; }),
                   pixels.end());
      if (int(pixels.size()) < rule_.least_area_px) continue;
      add(pixels, side, rule_.least_area_m2, false);
    }
  }

  void add(const Pixels& pixels, Side side, double least_area_m2, bool flat) {
    std::optional<Surface> surface = surface_of(views_, pixels, side);
    if (!surface || surface->area_m2 < least_area_m2) return;
    surface->label = int(found.size()) + 1;
    surface->flat = flat;
    std::size_t differing = 0;
    for (const std::size_t k : pixels) differing += masks_.pixel[k] | masks_.feature[k];
    surface->differing = double(differing) / double(pixels.size());
    if (!flat) surface->steps = median_of(depth_.steps, pixels);
    for (const std::size_t k : pixels) labels_[k] = surface->label;
    found.push_back(*surface);
  }

  cv::Mat around_found() const {
    cv::Mat occupied(views_.camera.height, views_.camera.width, CV_8U);
    for (std::size_t k = 0; k < views_.size(); ++k) {
      occupied.ptr<std::uint8_t>()[k] = labels_[k] != 0;
    }
    const int side = 2 * kShadow_px + 1;
    cv::dilate(occupied, occupied, cv::Mat::ones(side, side, CV_8U));
    return occupied;
  }

  const Views& views_;
  const Masks& masks_;
  const ObjectRule& rule_;
  const DepthChange depth_;
  Array<std::int32_t> labels_;
};

/// 0 to 1: whether these may be one object, by colour and size. Parts of either may be hidden.
double likeness(const Surface& a, const Surface& b) {
  const double one = (a.high - a.low).norm(), other = (b.high - b.low).norm();
  const double lengths = std::min(one, other) / std::max({one, other, 1e-9});
  const Eigen::Vector3d difference = a.color - b.color;
  const Eigen::Vector3d brightness = Eigen::Vector3d::Constant(difference.mean());
  const double step = (difference - (1 - kBrightnessShare) * brightness).norm();
  return std::sqrt(lengths) * std::exp2(-step / kColorStep);
}

/// 0 to 1: large surfaces that stand out far are certain.
double certainty(const Surface& surface, const ObjectRule& rule) {
  const double least_px = rule.least_area_px;
  const double by_area = 1 - std::exp(-surface.area_px / (2 * least_px));
  const double z = rule.step_m + rule.flat_step_m;
  const double by_step = surface.flat ? 0.6 : std::min(1.0, 0.5 + surface.step_m / (8 * z));
  return by_area * by_step;
}

}  // namespace

std::vector<ObjectChange> changes_of(const std::vector<Surface>& found, const ObjectRule& rule) {
  validate_rule(rule, "changes_of");
  struct Pair {
    double likeness;
    std::size_t before, after;
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = 0; j < found.size(); ++j) {
      if (found[i].side != Side::kBefore || found[j].side != Side::kAfter) continue;
      const double both = likeness(found[i], found[j]);
      if (both >= rule.alike) pairs.push_back({both, i, j});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.likeness > b.likeness; });
  std::vector<ObjectChange> changes;
  std::vector<bool> taken(found.size());
  for (const Pair& pair : pairs) {
    if (taken[pair.before] || taken[pair.after]) continue;
    taken[pair.before] = taken[pair.after] = true;
    const Surface &before = found[pair.before], &after = found[pair.after];
    const double certain = std::max(certainty(before, rule), certainty(after, rule));
    changes.push_back({ChangeType::kRelocation, certain, before, after});
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (taken[i]) continue;
    const Surface& surface = found[i];
    const double certain = certainty(surface, rule);
    if (found[i].side == Side::kBefore) {
      changes.push_back({ChangeType::kRemoval, certain, surface, std::nullopt});
    } else {
      changes.push_back({ChangeType::kAddition, certain, std::nullopt, surface});
    }
  }
  std::stable_sort(
      changes.begin(), changes.end(),
      [](const ObjectChange& a, const ObjectChange& b) { return a.confidence > b.confidence; });
  return changes;
}

Surfaces changed_surfaces(const Views& views, const Masks& masks, const ObjectRule& rule) {
  validate(views.camera, "changed_surfaces");
  validate_rule(rule, "changed_surfaces");
  Finder finder(views, masks, rule);
  finder.add_steps();
  finder.add_flats();
  return {std::move(finder.found), std::move(finder).labels()};
}

}  // namespace gslts::detect
