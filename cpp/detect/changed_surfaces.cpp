#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "depth_change.hpp"
#include "evidence.hpp"
#include "flat_change.hpp"
#include "gslts/detect/components.hpp"
#include "gslts/detect/objects.hpp"
#include "images.hpp"
#include "rules.hpp"
#include "surface_of.hpp"

namespace gslts::detect {
namespace {

void validate(const DepthNoise& noise, const char* function) {
  require_in(function, "noise.constant_m", noise.constant_m, 0, 100);
  require_in(function, "noise.per_m", noise.per_m, 0, 100);
  require_in(function, "noise at 1 m", noise.constant_m + noise.per_m, kMinDivisor, 200);
}

/// A surface and its pixels.
struct Part {
  Surface surface;
  double step_ratio;  ///< See `Evidence`.
  Pixels pixels;
};

/// Lists the pixels of the components of a mask, the largest component first.
std::vector<Pixels> regions_of(const cv::Mat& mask, int min_area_px) {
  const Components found = connected_components(mask.ptr<std::uint8_t>(), mask.cols, mask.rows);
  std::vector<Pixels> regions;
  for (const Component& component : found.components) {
    if (component.area < min_area_px) break;
    Pixels& pixels = regions.emplace_back();
    for (int row = component.y; row < component.y + component.height; ++row) {
      for (int column = component.x; column < component.x + component.width; ++column) {
        const std::size_t k = std::size_t(row) * std::size_t(mask.cols) + std::size_t(column);
        if (found.labels[k] == component.label) pixels.push_back(k);
      }
    }
  }
  return regions;
}

std::optional<Surface> large_surface(const Views& views, const Pixels& pixels, Side side,
                                     double min_area_m2) {
  std::optional<Surface> surface = surface_of(views, pixels, side);
  return surface && surface->area_m2 >= min_area_m2 ? surface : std::nullopt;
}

/// Finds the surfaces that are nearer than those of the other image.
/// @param mask  Where they are.
/// @param steps  As in `DepthChange`.
std::vector<Part> raised_parts(const Views& views, const Array<std::uint8_t>& mask, Side side,
                               const Array<float>& steps, const ObjectRule& rule) {
  cv::Mat joined;
  cv::dilate(image_of(mask, views.camera), joined, square(kJoin_px / 2));
  std::vector<Part> parts;
  for (Pixels& pixels : regions_of(joined, rule.min_area_px)) {
    const auto outside = [&](std::size_t k) { return mask[k] == 0; };
    pixels.erase(std::remove_if(pixels.begin(), pixels.end(), outside), pixels.end());
    if (int(pixels.size()) < rule.min_area_px) continue;
    std::optional<Surface> surface = large_surface(views, pixels, side, rule.min_area_m2);
    if (!surface) continue;
    std::vector<float> own_steps;
    for (const std::size_t k : pixels) own_steps.push_back(steps[k]);
    parts.push_back({*std::move(surface), median(std::move(own_steps)), std::move(pixels)});
  }
  return parts;
}

/// Tests whether the frame has depths where the map has a surface. Where it has none, as before a
/// window or a black sky, nobody knows whether the surface is still there.
bool is_measured(const Views& views, const Pixels& pixels) {
  const auto measured = std::count_if(pixels.begin(), pixels.end(), [&](std::size_t k) {
    return has_depth(views.observed_depth[k]);
  });
  return double(measured) >= kMinMeasuredShare * double(pixels.size());
}

/// Finds flat changes beside the parts found so far.
std::vector<Part> flat_parts(const Views& views, const ColorChange& colors,
                             const std::vector<Part>& raised, const ObjectRule& rule) {
  cv::Mat mask = colors.larger > rule.min_flat_color;
  for (const Part& part : raised) {
    for (const std::size_t k : part.pixels) mask.ptr<std::uint8_t>()[k] = 0;
  }
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, disc(1));
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc(1), {-1, -1}, 2);
  std::vector<Part> parts;
  for (Pixels& pixels : regions_of(mask, rule.min_area_px)) {
    const cv::Mat region = mask_of(pixels, views.camera);
    if (!has_outline(colors.larger, region)) continue;
    const std::optional<Side> side = side_of_flat(views, colors, region, rule);
    if (!side || (side == Side::kBefore && !is_measured(views, pixels))) continue;
    std::optional<Surface> surface = large_surface(views, pixels, *side, rule.min_flat_area_m2);
    if (!surface) continue;
    surface->flat = true;
    const double step_ratio = cv::mean(colors.larger, region)[0] / rule.min_flat_color;
    parts.push_back({*std::move(surface), step_ratio, std::move(pixels)});
  }
  return parts;
}

/// Distance between the boxes around two surfaces, m.
double gap_m(const Surface& a, const Surface& b) {
  return (a.low - b.high).cwiseMax(b.low - a.high).cwiseMax(0).norm();
}

bool are_one_object(const Surface& a, const Surface& b) {
  const double size_m = std::max((a.high - a.low).norm(), (b.high - b.low).norm());
  return a.side == b.side && gap_m(a, b) <= std::min(kMaxGap_m, kMaxGapShare * size_m);
}

/// Adds the pixels of another part to a part.
void join(const Views& views, Part& part, const Part& other) {
  if (other.pixels.size() > part.pixels.size() && !other.surface.flat) {
    part.step_ratio = other.step_ratio;
  }
  const Side side = part.surface.side;
  const bool flat = part.surface.flat && other.surface.flat;
  part.pixels.insert(part.pixels.end(), other.pixels.begin(), other.pixels.end());
  part.surface = *surface_of(views, part.pixels, side);
  part.surface.flat = flat;
}

/// Adds flat parts: one beside a raised part is more of it if both are of one side, else its
/// shadow.
void add_flat_parts(const Views& views, std::vector<Part> flats, std::vector<Part>& parts) {
  const std::size_t raised = parts.size();
  for (Part& flat : flats) {
    const auto end = parts.begin() + std::ptrdiff_t(raised);
    const auto near = std::find_if(parts.begin(), end, [&](const Part& part) {
      return gap_m(part.surface, flat.surface) <= kShadow_m;
    });
    if (near == end) {
      parts.push_back(std::move(flat));
    } else if (near->surface.side == flat.surface.side) {
      join(views, *near, flat);
    }
  }
}

/// Joins the parts of one object.
void join_parts(const Views& views, std::vector<Part>& parts) {
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::size_t j = i + 1;
    while (j < parts.size()) {
      if (!are_one_object(parts[i].surface, parts[j].surface)) {
        ++j;
        continue;
      }
      join(views, parts[i], parts[j]);
      parts.erase(parts.begin() + std::ptrdiff_t(j));
      j = i + 1;  // The whole is larger: what was too far away may be near.
    }
  }
}

double share_above(float threshold, const cv::Mat& values, const Pixels& pixels) {
  std::size_t above = 0;
  for (const std::size_t k : pixels) above += values.ptr<float>()[k] > threshold;
  return double(above) / double(pixels.size());
}

}  // namespace

Surfaces find_changed_surfaces(const Views& views, const Masks& masks, const ObjectRule& rule) {
  validate(views.camera, "find_changed_surfaces");
  validate(views.noise, "find_changed_surfaces");
  validate(rule, "find_changed_surfaces");
  const DepthChange depth = compare_depths(views, masks, rule);
  const ColorChange colors = compare_colors(views, masks, rule.edge_tolerance_px);
  std::vector<Part> parts = raised_parts(views, depth.appeared, Side::kAfter, depth.steps, rule);
  for (Part& part : raised_parts(views, depth.vanished, Side::kBefore, depth.steps, rule)) {
    parts.push_back(std::move(part));
  }
  add_flat_parts(views, flat_parts(views, colors, parts, rule), parts);
  join_parts(views, parts);

  Surfaces result;
  result.labels = Array<std::int32_t>(views.size(), 0);
  for (Part& part : parts) {
    Surface& surface = part.surface;
    surface.label = int(result.surfaces.size()) + 1;
    surface.evidence = evidence_of(views, masks, part.pixels, surface);
    surface.evidence.step_ratio = part.step_ratio;
    surface.evidence.changed_share =
        share_above(float(rule.min_flat_color), colors.larger, part.pixels);
    for (const std::size_t k : part.pixels) result.labels[k] = surface.label;
    result.surfaces.push_back(std::move(surface));
  }
  return result;
}

}  // namespace gslts::detect
