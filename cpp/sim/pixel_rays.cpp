#include "gslts/sim/pixel_rays.hpp"

#include <cstddef>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::sim {

Array<float> pixel_rays(const Camera& camera, int threads) {
  validate(camera, "pixel_rays");
  const auto width = std::size_t(camera.width), height = std::size_t(camera.height);
  const Eigen::Matrix3d axes = camera.world_from_camera.linear();
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<double> x(width);
  for (std::size_t column = 0; column < width; ++column) {
    x[column] = (double(column) + 0.5 - camera.cx) / camera.fx;
  }
  Array<float> rays(6 * width * height);
  parallel::parallel_for(height, threads, [&](std::size_t row) {
    const double y = (double(row) + 0.5 - camera.cy) / camera.fy;
    const double down[3] = {axes(0, 1) * y, axes(1, 1) * y, axes(2, 1) * y};
    float* ray = rays.data() + 6 * width * row;
    for (std::size_t column = 0; column < width; ++column, ray += 6) {
      for (int k = 0; k < 3; ++k) {
        ray[k] = eye[k];
        ray[3 + k] = float(axes(k, 0) * x[column] + down[k] + axes(k, 2));
      }
    }
  });
  return rays;
}

}  // namespace gslts::sim
