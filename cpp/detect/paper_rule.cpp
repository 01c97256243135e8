#include "gslts/detect/paper_rule.hpp"

#include <algorithm>
#include <cmath>

#include "rules.hpp"

namespace gslts::detect {
namespace {

/// D(p) for a centroid p = (u, v).
double depth_at(const float* depth, const Camera& camera, const Component& region) {
  const int column = std::clamp(int(region.u), 0, camera.width - 1);
  const int row = std::clamp(int(region.v), 0, camera.height - 1);
  const double z = depth[std::size_t(row) * camera.width + column];
  return z > 0 && std::isfinite(z) ? z : 0;
}

/// [u, v, D_pseudo(u, v)]; the depth is 0 if there is none.
Eigen::Vector3d key_point(const Views& views, const Component& region) {
  const double real = depth_at(views.measured, views.camera, region);
  const double of_map = depth_at(views.rendered, views.camera, region);
  const bool both = real > 0 && of_map > 0;
  return {region.u, region.v, both ? std::min(real, of_map) : std::max(real, of_map)};
}

Eigen::Vector3d in_world(const Camera& camera, const Eigen::Vector3d& seen) {
  const double z = seen.z();
  return camera.world_from_camera * Eigen::Vector3d((seen.x() - camera.cx) / camera.fx * z,
                                                    (seen.y() - camera.cy) / camera.fy * z, z);
}

/// Gamma_match
bool match(const Component& first, const Component& second, const PaperRule& rule, int width) {
  const auto [less, more] = std::minmax(first.area, second.area);
  const double distance_px = std::hypot(first.u - second.u, first.v - second.v);
  return double(less) / more > rule.tau_a && distance_px < rule.tau_d * width;
}

}  // namespace

std::optional<PaperChange> paper_change(const Views& views, const Components& components,
                                        const PaperRule& rule) {
  validate(views.camera, "paper_change");
  require_in("paper_change", "tau_change", rule.tau_change, 0, 1);
  require_in("paper_change", "tau_a", rule.tau_a, 0, 1);
  require_in("paper_change", "tau_d", rule.tau_d, 0, 10);
  require_in("paper_change", "epsilon", rule.epsilon, 0, 10);
  const std::vector<Component>& regions = components.components;
  double area = 0;
  for (const Component& one : regions) area += one.area;
  if (regions.empty() || area <= rule.tau_change * double(views.size())) return std::nullopt;

  const Component& first = regions[0];
  const Eigen::Vector3d at_first = key_point(views, first);
  if (regions.size() > 1 && match(first, regions[1], rule, views.camera.width)) {
    const Eigen::Vector3d at_second = key_point(views, regions[1]);
    if (at_first.z() > 0 && at_second.z() > 0) {
      const Eigen::Vector3d between = in_world(views.camera, 0.5 * (at_first + at_second));
      return PaperChange{ChangeType::kRelocation, between, first, regions[1]};
    }
  }
  const double real = depth_at(views.measured, views.camera, first);
  const double of_map = depth_at(views.rendered, views.camera, first);
  const double difference = real > 0 && of_map > 0 ? real - of_map : 0;
  if (std::abs(difference) <= rule.epsilon) return std::nullopt;
  const ChangeType type = difference < 0 ? ChangeType::kAddition : ChangeType::kRemoval;
  return PaperChange{type, in_world(views.camera, at_first), first, std::nullopt};
}

}  // namespace gslts::detect
