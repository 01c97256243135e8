// Long optimisations from starts that nobody should choose: every number stays finite, and the loss
// falls.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "gslts/optim/adam.hpp"
#include "gslts/optim/losses.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "raster_extremes.hpp"
#include "raster_scenes.hpp"

namespace gslts::optim {
namespace {

using namespace raster;
using namespace raster::testing;

constexpr int kSteps = 5000, kWidth = 28, kHeight = 20;
constexpr std::size_t kGaussians = 60;

/// A photograph with a saturated and a black area, and depth with holes.
struct Photograph {
  Camera camera;
  Array<float> rgb, depth;
};

Photograph photograph(Random& random, double angle_rad) {
  Photograph photo;
  const Eigen::Vector3d eye(3 * std::cos(angle_rad), 3 * std::sin(angle_rad), 1);
  photo.camera = camera_from_fov(kWidth, kHeight, 1.0, look_at(eye, {0, 0, 0}));
  photo.rgb.resize(3 * kWidth * kHeight);
  photo.depth.resize(kWidth * kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int pixel = y * kWidth + x;
      for (int c = 0; c < 3; ++c) {
        const float texture = float(0.5 + 0.4 * std::sin(0.7 * x + c) * std::cos(0.5 * y - c));
        photo.rgb[3 * pixel + c] = x < 9 ? 1.0f : x > 20 ? 0.0f : texture;
      }
      photo.depth[pixel] = random.uniform(0, 1) < 0.3 ? 0.0f : 3.0f;
    }
  }
  return photo;
}

/// Anywhere, even behind the cameras; each logarithm of a scale and each logit is at an end or in
/// between.
BasicGaussianMap<float> bad_start(Random& random) {
  const auto one_of = [&](double low, double high, double middle) {
    const double choice = random.uniform(0, 3);
    return float(choice < 1 ? low : choice < 2 ? high : middle);
  };
  auto map = make_gaussian_map<float>(kGaussians, 4);
  for (std::size_t n = 0; n < kGaussians; ++n) {
    for (int i = 0; i < 3; ++i) {
      map.means[3 * n + i] = float(2 * random.normal());
      map.log_scales[3 * n + i] = one_of(std::log(1e-8), std::log(1e4), -2 + random.normal());
    }
    const Eigen::Vector4d quat = random.quat();
    const float length = one_of(1e-20, 1e15, 1);
    for (int i = 0; i < 4; ++i) map.quats[4 * n + i] = length * float(quat[i]);
    map.logit_opacities[n] = one_of(-50, 50, random.normal());
  }
  for (float& value : map.sh) value = float(random.normal());
  return map;
}

class TrainingStability : public ::testing::TestWithParam<std::uint32_t> {};

TEST_P(TrainingStability, EveryNumberStaysFiniteAndTheLossFalls) {
  Random random(GetParam());
  std::vector<Photograph> photographs;
  for (double angle_rad : {0.0, 2.0, 4.0}) photographs.push_back(photograph(random, angle_rad));
  auto map = bad_start(random);
  Adam<float> adam(map.size(), map.sh_bases);
  AdamRates rates;
  rates.means = 2e-3;
  rates.quats = 1e-3;
  rates.log_scales = 5e-3;
  rates.logit_opacities = 5e-2;
  rates.sh_dc = 2.5e-3;
  rates.sh_rest = 1.25e-4;
  RenderOptions options;
  options.threads = 1;
  Rasterizer<float> rasterizer;
  // Every second seed also lets a gain and an offset follow each photograph.
  const bool fits_exposure = GetParam() % 2 == 1;
  const auto lose = [&](const Photograph& photo, bool move) {
    const auto images = rasterizer.forward(map.view(), photo.camera, options);
    const Exposure exposure =
        fits_exposure ? fit_exposure(images.rgb.data(), photo.rgb.data(), kWidth, kHeight)
                      : Exposure();
    const auto colour = photometric_loss(images.rgb.data(), photo.rgb.data(), kWidth, kHeight, {},
                                         0.2, exposure, 1);
    const auto depth = depth_loss(images.depth.data(), photo.depth.data(), kWidth, kHeight);
    if (move) {
      const auto gradients = rasterizer.backward(
          map.view(), {colour.dL_drgb.data(), depth.dL_ddepth.data(), nullptr, nullptr});
      adam.step(map, gradients.view(), rates, 1);
    }
    return colour.value + depth.value;
  };
  const auto total = [&] {
    double sum = 0;
    for (const Photograph& photo : photographs) sum += lose(photo, false);
    return sum;
  };

  const double before = total();
  for (int step = 0; step < kSteps; ++step) {
    ASSERT_TRUE(std::isfinite(lose(photographs[step % 3], true))) << "step " << step;
  }
  EXPECT_TRUE(all_finite(map.means));
  EXPECT_TRUE(all_finite(map.quats));
  EXPECT_TRUE(all_finite(map.log_scales));
  EXPECT_TRUE(all_finite(map.logit_opacities));
  EXPECT_TRUE(all_finite(map.sh));
  EXPECT_TRUE(all_finite(adam.state().first));
  EXPECT_TRUE(all_finite(adam.state().second));
  EXPECT_LT(total(), before);
}

INSTANTIATE_TEST_SUITE_P(Seeds, TrainingStability, ::testing::Range(0u, 20u));

}  // namespace
}  // namespace gslts::optim
