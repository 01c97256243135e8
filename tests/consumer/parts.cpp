// Calls each of the small libraries once: simd, io, fusion, optim, align and plan.
#include <cstdint>
#include <gslts/align/normal_equations.hpp>
#include <gslts/fusion/register_depth.hpp>
#include <gslts/io/ply.hpp>
#include <gslts/optim/losses.hpp>
#include <gslts/plan/distance_field.hpp>
#include <gslts/simd/target.hpp>
#include <iostream>
#include <vector>

namespace {

bool check(const char* name, bool holds) {
  if (!holds) std::cerr << name << " failed\n";
  return holds;
}

}  // namespace

int main() {
  constexpr int kWidth = 32, kHeight = 24;
  const gslts::Camera camera = gslts::camera_from_fov(kWidth, kHeight, 1.0);
  const std::vector<float> rgb(3 * kWidth * kHeight, 0.5f), depth(kWidth * kHeight, 2.0f);

  const auto contents = gslts::io::parse_ply(
      "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
      "property float z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
      "property float opacity\nproperty float scale_0\nproperty float scale_1\n"
      "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\nend_header\n",
      "empty.ply");
  const auto registered = gslts::fusion::register_depth(depth.data(), camera, camera);
  const auto loss = gslts::optim::photometric_loss(rgb.data(), rgb.data(), kWidth, kHeight);
  const auto equations =
      gslts::align::align(camera, rgb.data(), depth.data(), rgb.data(), depth.data());
  const std::uint8_t free[] = {1, 1, 1}, goals[] = {1, 0, 0};
  const auto field_m = gslts::plan::distance_field(free, goals, 1, 3, 0.5);
  const bool right =
      check("simd", !gslts::simd::target().empty()) & check("io", contents.map.size() == 0) &
      check("fusion", registered[kWidth * kHeight / 2] == 2.0f) &
      check("optim", loss.value < 1e-4) & check("align", equations.depth.hessian(2, 2) > 0) &
      check("plan", field_m[2] == 1.0);
  return right ? 0 : 1;
}
