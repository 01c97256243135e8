#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "gslts/detect/masks.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect::testing {

/// A plain wall 2 m in front of the camera, rendered exactly; tests change parts of it.
struct ImagePair {
  static constexpr int kWidth = 160, kHeight = 120;
  static constexpr float kWall_m = 2.0f;

  Camera camera{160, 160, 80, 60, kWidth, kHeight, Eigen::Isometry3d::Identity()};
  std::vector<float> observed_rgb = std::vector<float>(3 * kWidth * kHeight, 0.5f);
  std::vector<float> rendered_rgb = observed_rgb;
  std::vector<float> observed_depth = std::vector<float>(kWidth * kHeight, kWall_m);
  std::vector<float> rendered_depth = observed_depth;
  std::vector<float> alpha = std::vector<float>(kWidth * kHeight, 1.0f);
  std::vector<float> similarity = std::vector<float>(kWidth * kHeight, 1.0f);

  Views views() const {
    return {camera,
            observed_rgb.data(),
            rendered_rgb.data(),
            observed_depth.data(),
            rendered_depth.data(),
            alpha.data(),
            similarity.data()};
  }

  enum class In { kFrame, kMap };

  /// A box facing the camera: columns [x, x + width), rows [y, y + height), at a depth, in a
  /// colour.
  void put(In where, int x, int y, int width, int height, float depth_m, float red, float green,
           float blue) {
    std::vector<float>& colors = where == In::kFrame ? observed_rgb : rendered_rgb;
    std::vector<float>& depths = where == In::kFrame ? observed_depth : rendered_depth;
    for (int row = y; row < y + height; ++row) {
      for (int column = x; column < x + width; ++column) {
        const std::size_t k = std::size_t(row) * kWidth + column;
        const float color[3] = {red, green, blue};
        std::copy(color, color + 3, &colors[3 * k]);
        depths[k] = depth_m;
        similarity[k] = 0;
      }
    }
  }
};

}  // namespace gslts::detect::testing
