// Checks that a box in front of a wall, which the map shows without it, is found as an addition.
#include <algorithm>
#include <cstddef>
#include <gslts/detect/masks.hpp>
#include <gslts/detect/objects.hpp>
#include <gslts/map/camera.hpp>
#include <iostream>
#include <vector>

int main() {
  constexpr int kWidth = 160, kHeight = 120;
  constexpr std::size_t kSize = std::size_t(kWidth) * kHeight;
  const gslts::Camera camera = gslts::camera_from_fov(kWidth, kHeight, 1.0);
  const std::vector<float> rendered_rgb(3 * kSize, 0.5f), rendered_depth(kSize, 2.0f);
  const std::vector<float> alpha(kSize, 1.0f);
  std::vector<float> observed_rgb = rendered_rgb, observed_depth = rendered_depth;
  std::vector<float> similarity(kSize, 1.0f);
  // Columns 60 to 99 and rows 40 to 79, around the axis of the camera.
  for (int row = 40; row < 80; ++row) {
    for (int column = 60; column < 100; ++column) {
      const std::size_t k = std::size_t(row) * kWidth + column;
      std::fill_n(&observed_rgb[3 * k], 3, 0.9f);
      observed_depth[k] = 1.5f;
      similarity[k] = 0.0f;
    }
  }
  const gslts::detect::Views views{camera,
                                   observed_rgb.data(),
                                   rendered_rgb.data(),
                                   observed_depth.data(),
                                   rendered_depth.data(),
                                   alpha.data(),
                                   similarity.data()};
  const auto masks = gslts::detect::compute_masks(views, {});
  const auto found = gslts::detect::find_changed_surfaces(views, masks, {});
  const auto changes = gslts::detect::classify_changes(found.surfaces, {});
  if (changes.size() != 1 || changes[0].type != gslts::detect::ChangeType::kAddition) {
    std::cerr << changes.size() << " changes, or the first is no addition\n";
    return 1;
  }
  const auto& point = changes[0].after->point;
  const double off_m = (point - camera.world_from_camera * Eigen::Vector3d(0, 0, 1.5)).norm();
  if (off_m < 0.02) return 0;
  std::cerr << "found at " << point.transpose() << '\n';
  return 1;
}
