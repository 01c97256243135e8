// Finds the keypoints of an image, and brings a corner of a room that was moved back onto itself.
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <gslts/reloc/features.hpp>
#include <gslts/reloc/register_clouds.hpp>
#include <iostream>
#include <vector>

int main() {
  constexpr int kWidth = 160, kHeight = 120;
  std::vector<std::uint8_t> grey(std::size_t(kWidth) * kHeight);
  for (std::size_t row = 0; row < kHeight; ++row) {
    for (std::size_t column = 0; column < kWidth; ++column) {
      grey[row * kWidth + column] = (row / 12 * 7 + column / 12 * 5) % 3 == 0 ? 220 : 40;
    }
  }
  const auto features = gslts::reloc::features_of(grey.data(), kWidth, kHeight);
  if (features.size() == 0 || features.descriptors.size() != 32 * features.size()) {
    std::cerr << features.size() << " features\n";
    return 1;
  }

  // Three sides of a cube of 2 m, in steps of 4 cm.
  std::vector<float> corner, moved;
  const Eigen::Isometry3d expected =
      Eigen::Translation3d(0.03, -0.02, 0.04) * Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitZ());
  for (int i = 0; i < 50; ++i) {
    for (int k = 0; k < 50; ++k) {
      const double a = 0.04 * i, b = 0.04 * k;
      for (const Eigen::Vector3d& point :
           {Eigen::Vector3d(a, b, 0), Eigen::Vector3d(0, a, b), Eigen::Vector3d(a, 0, b)}) {
        const Eigen::Vector3d there = expected * point;
        for (int axis = 0; axis < 3; ++axis) {
          corner.push_back(float(point[axis]));
          moved.push_back(float(there[axis]));
        }
      }
    }
  }
  const auto found = gslts::reloc::register_clouds(corner.data(), corner.size() / 3, moved.data(),
                                                   moved.size() / 3, Eigen::Isometry3d::Identity());
  const Eigen::Vector3d middle(1, 1, 1);
  const double off_m = (found.target_from_source * middle - expected * middle).norm();
  if (found.converged && off_m < 0.005) return 0;
  std::cerr << "brought to " << off_m << " m off\n";
  return 1;
}
