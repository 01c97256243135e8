#include "gslts/detect/gs_lts_rule.hpp"

#include <algorithm>
#include <cmath>

#include "images.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

void validate(const GsLtsRule& rule) {
  require_in("detect_gs_lts", "tau_change", rule.tau_change, 0, 1);
  require_in("detect_gs_lts", "tau_a", rule.tau_a, 0, 1);
  require_in("detect_gs_lts", "tau_d", rule.tau_d, 0, 10);
  require_in("detect_gs_lts", "epsilon", rule.epsilon, 0, 10);
}

/// D(p_c), m; 0 if there is none.
double depth_at_centroid(const float* depth, const Camera& camera, const Component& region) {
  const int column = std::clamp(int(region.u), 0, camera.width - 1);
  const int row = std::clamp(int(region.v), 0, camera.height - 1);
  const float z = depth[std::size_t(row) * camera.width + column];
  return has_depth(z) ? double(z) : 0;
}

/// d_real and d_GS (eq. 7), m; 0 where there is none.
struct CentroidDepths {
  double real, gs;

  CentroidDepths(const Views& views, const Component& region)
      : real(depth_at_centroid(views.observed_depth, views.camera, region)),
        gs(depth_at_centroid(views.rendered_depth, views.camera, region)) {}

  bool both() const { return real > 0 && gs > 0; }
  /// Delta d = d_real - d_GS (eq. 8).
  double difference() const { return both() ? real - gs : 0; }
  /// D_pseudo = min(d_real, d_GS).
  double pseudo() const { return both() ? std::min(real, gs) : std::max(real, gs); }
};

/// p_cam = [u, v, D_pseudo(u, v)] (eq. 9).
Eigen::Vector3d key_point(const Views& views, const Component& region) {
  return {region.u, region.v, CentroidDepths(views, region).pseudo()};
}

/// p_world (eq. 10).
Eigen::Vector3d to_world(const Camera& camera, const Eigen::Vector3d& p_cam) {
  return unproject(camera, p_cam.x(), p_cam.y(), p_cam.z());
}

/// Gamma_match (eq. 6).
bool regions_match(const Component& first, const Component& second, const GsLtsRule& rule,
                   int width) {
  const auto [less, more] = std::minmax(first.area, second.area);
  const double distance_px = std::hypot(first.u - second.u, first.v - second.v);
  return double(less) / more > rule.tau_a && distance_px < rule.tau_d * width;
}

}  // namespace

std::optional<GsLtsChange> detect_gs_lts(const Views& views, const Components& components,
                                         const GsLtsRule& rule) {
  gslts::validate(views.camera, "detect_gs_lts");
  validate(rule);
  const std::vector<Component>& regions = components.components;
  double area = 0;
  for (const Component& region : regions) area += region.area;
  if (regions.empty() || area <= rule.tau_change * double(views.size())) return std::nullopt;

  const Component& first = regions[0];
  const Eigen::Vector3d at_first = key_point(views, first);
  if (regions.size() > 1 && regions_match(first, regions[1], rule, views.camera.width)) {
    const Eigen::Vector3d at_second = key_point(views, regions[1]);
    if (at_first.z() > 0 && at_second.z() > 0) {
      const Eigen::Vector3d between = to_world(views.camera, 0.5 * (at_first + at_second));
      return GsLtsChange{ChangeType::kRelocation, between, first, regions[1]};
    }
  }
  const double difference = CentroidDepths(views, first).difference();
  if (std::abs(difference) <= rule.epsilon) return std::nullopt;
  const ChangeType type = difference < 0 ? ChangeType::kAddition : ChangeType::kRemoval;
  return GsLtsChange{type, to_world(views.camera, at_first), first, std::nullopt};
}

}  // namespace gslts::detect
