#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "depth_change.hpp"
#include "evidence.hpp"
#include "flat_change.hpp"
#include "gslts/detect/components.hpp"
#include "gslts/detect/objects.hpp"
#include "mat.hpp"
#include "rules.hpp"
#include "surface_of.hpp"

namespace gslts::detect {
namespace {

/// Side of the window that joins parts of one object: bars of a chair, say.
constexpr int kJoin_px = 3;
/// Around an object that changed, what is flat is its shadow or more of it.
constexpr double kShadow_m = 0.15;
/// Parts of one object are no farther apart, and by no more than a share of its size.
constexpr double kGap_m = 0.12, kGapShare = 0.5;

/// A surface, and where it is in the image.
struct Part {
  Surface surface;
  double steps;  ///< See `Evidence`.
  Pixels pixels;
};

Pixels pixels_of(const Components& components, const Component& one, int width) {
  Pixels pixels;
  pixels.reserve(std::size_t(one.area));
  for (int row = one.y; row < one.y + one.height; ++row) {
    for (int column = one.x; column < one.x + one.width; ++column) {
      const std::size_t k = std::size_t(row) * std::size_t(width) + std::size_t(column);
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

double share_above(float least, const cv::Mat& values, const Pixels& pixels) {
  std::size_t above = 0;
  for (const std::size_t k : pixels) above += values.ptr<float>()[k] > least;
  return double(above) / double(pixels.size());
}

/// Between the boxes around two surfaces, m.
double gap_m(const Surface& a, const Surface& b) {
  return (a.low - b.high).cwiseMax(b.low - a.high).cwiseMax(0).norm();
}

bool are_parts(const Surface& a, const Surface& b) {
  const double size_m = std::max((a.high - a.low).norm(), (b.high - b.low).norm());
  return a.side == b.side && gap_m(a, b) <= std::min(kGap_m, kGapShare * size_m);
}

class Finder {
 public:
  Finder(const Views& views, const Masks& masks, const ObjectRule& rule)
      : views_(views),
        masks_(masks),
        rule_(rule),
        foreign_(foreign_colors(views, masks, rule.reach_px)),
        most_(cv::max(foreign_.in_photo, foreign_.in_map)) {}

  Surfaces found() {
    const DepthChange depth = depth_change_of(views_, masks_, rule_);
    add_steps(depth.appeared, Side::kAfter, depth.steps);
    add_steps(depth.vanished, Side::kBefore, depth.steps);
    add_flats();
    join_parts();
    Surfaces result;
    result.labels = Array<std::int32_t>(views_.size(), 0);
    for (Part& part : parts_) {
      part.surface.label = int(result.surfaces.size()) + 1;
      part.surface.evidence = evidence_of(views_, masks_, part.pixels, part.surface);
      part.surface.evidence.steps = part.steps;
      part.surface.evidence.differing = share_above(float(rule_.flat_color), most_, part.pixels);
      for (const std::size_t k : part.pixels) result.labels[k] = part.surface.label;
      result.surfaces.push_back(std::move(part.surface));
    }
    return result;
  }

 private:
  void add_steps(const Array<std::uint8_t>& mask, Side side, const Array<float>& steps) {
    const int width = views_.camera.width;
    cv::Mat joined;
    cv::dilate(mask_of(mask, views_.camera), joined, cv::Mat::ones(kJoin_px, kJoin_px, CV_8U));
    const Components components =
        components_of(joined.ptr<std::uint8_t>(), width, views_.camera.height);
    for (const Component& component : components.components) {
      if (component.area < rule_.least_area_px) break;  // The largest come first.
      Pixels pixels = pixels_of(components, component, width);
      const auto outside = [&](std::size_t k) { return mask[k] == 0; };
      pixels.erase(std::remove_if(pixels.begin(), pixels.end(), outside), pixels.end());
      if (int(pixels.size()) < rule_.least_area_px) continue;
      std::optional<Surface> surface = seen_at(pixels, side, rule_.least_area_m2);
      if (!surface) continue;
      parts_.push_back({*surface, median_of(steps, pixels), std::move(pixels)});
    }
  }

  /// What colours tell beside that.
  void add_flats() {
    cv::Mat mask = most_ > rule_.flat_color;
    for (const Part& part : parts_) {
      for (const std::size_t k : part.pixels) mask.ptr<std::uint8_t>()[k] = 0;
    }
    const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
    cv::morphologyEx(mask, mask, cv::MORPH_OPEN, disc);
    cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc, {-1, -1}, 2);
    const int width = views_.camera.width;
    const Components components =
        components_of(mask.ptr<std::uint8_t>(), width, views_.camera.height);
    const std::size_t others = parts_.size();
    for (const Component& component : components.components) {
      if (component.area < rule_.least_area_px) break;
      Pixels pixels = pixels_of(components, component, width);
      cv::Mat region = cv::Mat::zeros(views_.camera.height, width, CV_8U);
      for (const std::size_t k : pixels) region.ptr<std::uint8_t>()[k] = 255;
      if (!has_outline(most_, region)) continue;
      const std::optional<Side> side = side_of_flat(views_, foreign_, region, rule_);
      if (!side) continue;
      std::optional<Surface> surface = seen_at(pixels, *side, rule_.flat_area_m2);
      if (!surface) continue;
      surface->flat = true;
      const double steps = cv::mean(most_, region)[0] / rule_.flat_color;
      add_flat({*surface, steps, std::move(pixels)}, others);
    }
  }

  /// Beside one of the first parts, a flat one is more of it if it is of its side, else its shadow.
  void add_flat(Part flat, std::size_t others) {
    const auto end = parts_.begin() + std::ptrdiff_t(others);
    const auto near = std::find_if(parts_.begin(), end, [&](const Part& part) {
      return gap_m(part.surface, flat.surface) <= kShadow_m;
    });
    if (near == end) {
      parts_.push_back(std::move(flat));
    } else if (near->surface.side == flat.surface.side) {
      join(*near, flat);
    }
  }

  void join_parts() {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      std::size_t j = i + 1;
      while (j < parts_.size()) {
        if (!are_parts(parts_[i].surface, parts_[j].surface)) {
          ++j;
          continue;
        }
        join(parts_[i], parts_[j]);
        parts_.erase(parts_.begin() + std::ptrdiff_t(j));
        j = i + 1;  // The whole is larger: what was too far away may be near.
      }
    }
  }

  void join(Part& part, const Part& other) const {
    if (other.pixels.size() > part.pixels.size() && !other.surface.flat) part.steps = other.steps;
    const Side side = part.surface.side;
    const bool flat = part.surface.flat && other.surface.flat;
    part.pixels.insert(part.pixels.end(), other.pixels.begin(), other.pixels.end());
    part.surface = *surface_of(views_, part.pixels, side);
    part.surface.flat = flat;
  }

  std::optional<Surface> seen_at(const Pixels& pixels, Side side, double least_area_m2) const {
    std::optional<Surface> surface = surface_of(views_, pixels, side);
    if (!surface || surface->area_m2 < least_area_m2) return std::nullopt;
    return surface;
  }

  const Views& views_;
  const Masks& masks_;
  const ObjectRule& rule_;
  const Foreign foreign_;
  const cv::Mat most_;  ///< The larger of both.
  std::vector<Part> parts_;
};

}  // namespace

Surfaces changed_surfaces(const Views& views, const Masks& masks, const ObjectRule& rule) {
  validate(views.camera, "changed_surfaces");
  validate(rule, "changed_surfaces");
  return Finder(views, masks, rule).found();
}

}  // namespace gslts::detect
