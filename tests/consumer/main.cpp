// Renders one Gaussian in front of a camera and checks the pixel at its centre.
#include <array>
#include <cmath>
#include <gslts/map/camera.hpp>
#include <gslts/map/gaussian_map.hpp>
#include <gslts/raster/rasterizer.hpp>
#include <iostream>

int main() {
  // A ball with a standard deviation of 0.2 m, 2 m in front of the camera; its opacity is
  // sigmoid(0) = 0.5 and its colour 0.5 + sh / (2 sqrt(pi)).
  const std::array<float, 3> mean{0.0f, 0.0f, 2.0f};
  const std::array<float, 4> quat{1.0f, 0.0f, 0.0f, 0.0f};
  const float log_scale = std::log(0.2f);
  const std::array<float, 3> log_scales{log_scale, log_scale, log_scale};
  const float logit_opacity = 0.0f;
  const std::array<float, 3> colour{0.9f, 0.5f, 0.2f};
  std::array<float, 3> sh{};
  for (std::size_t i = 0; i < 3; ++i) sh[i] = (colour[i] - 0.5f) / 0.28209479177387814f;

  gslts::GaussianView<float> gaussians;
  gaussians.size = 1;
  gaussians.means = mean.data();
  gaussians.quats = quat.data();
  gaussians.log_scales = log_scales.data();
  gaussians.logit_opacities = &logit_opacity;
  gaussians.sh = sh.data();

  // The width and height are odd: the optical axis runs through the centre of a pixel.
  const gslts::Camera camera = gslts::camera_from_fov(65, 49, 1.0);
  gslts::raster::Rasterizer<float> rasterizer;
  const auto images = rasterizer.forward(gaussians, camera);

  const std::size_t centre = 24 * 65 + 32;
  bool right = true;
  const auto check = [&](const char* name, float value, float expected) {
    if (std::abs(value - expected) <= 1e-4f) return;
    std::cerr << name << " is " << value << ", not " << expected << '\n';
    right = false;
  };
  check("alpha", images.alpha[centre], 0.5f);
  check("depth", images.depth[centre], 2.0f);
  check("red", images.rgb[3 * centre], 0.5f * colour[0]);
  check("green", images.rgb[3 * centre + 1], 0.5f * colour[1]);
  check("blue", images.rgb[3 * centre + 2], 0.5f * colour[2]);
  return right ? 0 : 1;
}
