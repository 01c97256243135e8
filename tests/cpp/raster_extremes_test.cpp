// Gaussians and cameras at the ends of what numbers can hold: no NaN, no infinity, no crash, and
// where the image is smooth, in double, the right gradient.

#include "raster_extremes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace gslts::raster {
namespace {

using namespace testing;

template <typename T>
class RasterExtremes : public ::testing::Test {
 protected:
  /// Gaussians at random places before the camera.
  static BasicGaussianMap<T> scene(std::size_t gaussians, std::uint32_t seed = 1,
                                   int sh_bases = 4) {
    SceneShape shape;
    shape.gaussians = gaussians;
    shape.sh_bases = sh_bases;
    return converted<T>(random_scene(seed, camera(), shape));
  }
  static Camera camera() { return tilted_camera(64, 48); }
  static RenderOptions antialiased(bool antialias) {
    RenderOptions options;
    options.antialias = antialias;
    return options;
  }
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterExtremes, Scalars);

TYPED_TEST(RasterExtremes, ScalesFromAtomsToContinents) {
  Random random(2);
  auto map = this->scene(2000);
  for (TypeParam& value : map.log_scales) {
    value = TypeParam(random.uniform(std::log(1e-8), std::log(1e4)));
  }
  for (bool antialias : {false, true}) {
    expect_survival(map, this->camera(), this->antialiased(antialias));
    RenderOptions unfiltered = this->antialiased(antialias);
    unfiltered.eps2d_px2 = 0;
    expect_survival(map, this->camera(), unfiltered);
  }
}

TYPED_TEST(RasterExtremes, LogScalesAndLogitsOfAnySize) {
  Random random(3);
  auto map = this->scene(2000);
  const double sizes[] = {-1e30, -1e3, -200, -80, -3, 20, 29.9, 30, 31, 80, 1e3, 1e30};
  const auto any = [&] { return TypeParam(sizes[std::size_t(random.uniform(0, 12))]); };
  for (TypeParam& value : map.log_scales) value = any();
  for (TypeParam& value : map.logit_opacities) value = any();
  for (bool antialias : {false, true}) {
    expect_survival(map, this->camera(), this->antialiased(antialias));
    RenderOptions unfiltered = this->antialiased(antialias);
    unfiltered.eps2d_px2 = 0;
    expect_survival(map, this->camera(), unfiltered);
  }
}

/// Without a low-pass filter, a Gaussian whose scale underflows has no extent at all.
TYPED_TEST(RasterExtremes, AGaussianWithoutExtentTouchesNoOtherPixel) {
  const Camera camera = straight_camera(41, 41, 100);
  auto map = map_of<TypeParam>({Gaussian()});
  RenderOptions options;
  options.eps2d_px2 = 0;
  for (double log_scale : {-1e3, -200.0, -90.0, -50.0, -20.0}) {
    std::fill(map.log_scales.begin(), map.log_scales.end(), TypeParam(log_scale));
    const auto images = expect_survival(map, camera, options).images;
    for (std::size_t i = 0; i < images.alpha.size(); ++i) {
      if (i == 20 * 41 + 20) continue;
      ASSERT_EQ(images.alpha[i], 0) << i << " with log scale " << log_scale;
    }
  }
}

TYPED_TEST(RasterExtremes, NeedlesAndDiscs) {
  const Camera camera = straight_camera(32, 24, 30);
  Random random(4);
  std::vector<Gaussian> gaussians(12);
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    Gaussian& g = gaussians[i];
    g.mean = {random.uniform(-0.5, 0.5), random.uniform(-0.4, 0.4), 1.5 + 0.2 * double(i)};
    g.scale_m = i % 2 ? Eigen::Vector3d(0.5, 5e-7, 5e-7) : Eigen::Vector3d(0.5, 0.4, 5e-7);
    g.quat_wxyz = random.quat().normalized();
    g.color = {random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)};
  }
  const auto map = map_of<TypeParam>(gaussians);
  for (bool antialias : {false, true}) {
    RenderOptions options = without_jumps();
    options.antialias = antialias;
    expect_survival(map, camera, options);
    // An antialiased needle all but vanishes; the disc's edges give the gradient.
    expect_spot_derivatives(map, camera, options, {0, 2, 4});
    if (!antialias) expect_spot_derivatives(map, camera, options, {1, 3, 5});
  }
}

TYPED_TEST(RasterExtremes, NeedlesInFloatLookLikeThoseInDouble) {
  const Camera camera = tilted_camera(160, 120);
  Random random(5);
  SceneShape shape;
  shape.gaussians = 200;
  auto map = converted<TypeParam>(random_scene(5, camera, shape));
  for (std::size_t n = 0; n < map.size(); ++n) {
    const double length = random.uniform(std::log(0.05), std::log(2.0));
    for (std::size_t i = 0; i < 3; ++i) {
      map.log_scales[3 * n + i] = TypeParam(i == n % 3 ? length : length - std::log(1e6));
    }
  }
  const auto images = Rasterizer<TypeParam>().forward(map.view(), camera);
  const auto exact = Rasterizer<double>().forward(converted<double>(map).view(), camera);
  double sum2 = 0;
  for (std::size_t i = 0; i < exact.rgb.size(); ++i) {
    sum2 += std::pow(double(images.rgb[i]) - exact.rgb[i], 2);
  }
  EXPECT_LT(std::sqrt(sum2 / double(exact.rgb.size())), 3e-4);
}

TYPED_TEST(RasterExtremes, QuaternionsOfAnyLength) {
  using Limits = std::numeric_limits<TypeParam>;
  auto map = this->scene(300);
  const TypeParam lengths[] = {0,
                               TypeParam(-0.0),
                               Limits::denorm_min(),
                               Limits::min(),
                               TypeParam(1e-20),
                               TypeParam(1e-12),
                               TypeParam(1e20),
                               Limits::max() / 16};
  for (std::size_t i = 0; i < map.quats.size(); ++i) map.quats[i] *= lengths[i / 4 % 8];
  const auto gradients = expect_survival(map, this->camera()).gradients;
  for (std::size_t v = 0; v < gradients.rows.size(); ++v) {
    if (gradients.rows[v] % 8 >= 5) continue;
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(gradients.dL_dquats[4 * v + i], 0);
  }
  for (std::size_t i = 0; i < map.quats.size(); ++i) map.quats[i] = i % 4 ? 0 : Limits::max();
  expect_survival(map, this->camera());
  std::fill(map.quats.begin(), map.quats.end(), Limits::lowest());
  expect_survival(map, this->camera());
}

TYPED_TEST(RasterExtremes, OpacitiesOfAllAndNothing) {
  auto map = this->scene(300);
  for (std::size_t i = 0; i < map.size(); ++i) map.logit_opacities[i] = i % 2 ? 50 : -50;
  expect_survival(map, this->camera());
  RenderOptions options = without_jumps();
  options.alpha_min = 1e-30;
  expect_survival(map, this->camera(), options);
  std::fill(map.logit_opacities.begin(), map.logit_opacities.end(), TypeParam(-50));
  const auto faint = expect_survival(map, this->camera(), options);
  EXPECT_GT(*std::max_element(faint.images.alpha.begin(), faint.images.alpha.end()), 0);
  expect_spot_derivatives(map, this->camera(), options, {0, 7, 20});
}

TYPED_TEST(RasterExtremes, ColoursOfAnySize) {
  Random random(6);
  auto map = this->scene(300, 6, 16);
  for (TypeParam& value : map.sh) value = TypeParam(random.uniform(-1e4, 1e4));
  expect_survival(map, this->camera());
  for (TypeParam& value : map.sh)
    value = random.uniform(0, 1) < 0.5 ? TypeParam(-1e20) : TypeParam(1e20);
  expect_survival(map, this->camera());
}

TYPED_TEST(RasterExtremes, AtTheNearPlaneAndTheCamera) {
  const Camera camera = straight_camera(64, 48, 50);
  for (double near_m : {0.05, 1e-6, 1e-20, 1e-37}) {
    RenderOptions options;
    options.near_m = near_m;
    std::vector<Gaussian> gaussians;
    for (double z : {-1.0, -near_m, 0.0, near_m, 1.0000002 * near_m, 1.01 * near_m, 2 * near_m}) {
      for (double x : {0.0, 0.5 * near_m, 1e-3, 1.0, 100.0}) {
        for (double scale : {1e-8, 1e-3, 1.0, 1e4}) {
          Gaussian g;
          g.mean = {x, -x, z};
          g.scale_m.setConstant(scale);
          gaussians.push_back(g);
        }
      }
    }
    const auto map = map_of<TypeParam>(gaussians, 4);
    for (bool antialias : {false, true}) {
      SCOPED_TRACE(near_m);
      options.antialias = antialias;
      const auto gradients = expect_survival(map, camera, options).gradients;
      for (std::uint32_t row : gradients.rows) EXPECT_GE(row, 60u) << "not in front";
    }
  }
}

TYPED_TEST(RasterExtremes, MeansOfAnySize) {
  auto map = this->scene(400);
  Random random(7);
  for (TypeParam& value : map.means) {
    value = TypeParam(value * std::pow(10, random.uniform(-30, 30)));
  }
  expect_survival(map, this->camera());
  // Straight ahead, they stay in view.
  std::vector<Gaussian> ahead;
  for (double z : {1e6, 1e12, 1e18, 1e25, 1e30}) {
    Gaussian g;
    g.mean = {0, 0, z};
    ahead.push_back(g);
  }
  const Camera camera = straight_camera(9, 9, 50);
  const auto far = expect_survival(map_of<TypeParam>(ahead, 16), camera);
  EXPECT_GT(far.images.alpha[4 * 9 + 4], 0.5);
}

TYPED_TEST(RasterExtremes, FieldsOfView) {
  const Eigen::Isometry3d pose = this->camera().world_from_camera;
  for (double degrees : {0.1, 170.0, 179.9}) {
    const Camera camera = camera_from_fov(48, 32, degrees * kPi / 180, pose);
    SceneShape shape;
    shape.sh_bases = 4;
    shape.gaussians = 60;
    shape.min_scale_px = 0.5;
    const auto map = converted<TypeParam>(random_scene(8, camera, shape));
    SCOPED_TRACE(degrees);
    const auto gradients = expect_survival(map, camera, without_jumps()).gradients;
    ASSERT_GT(gradients.rows.size(), 20u);
    Steps steps;
    steps.means = 0.1 / camera.fx * 1e-3;
    steps.twist = std::min(steps.means, 1e-7);  // What is wide turns by as much as what is narrow.
    expect_spot_derivatives(map, camera, without_jumps(),
                            {gradients.rows[0], gradients.rows[9], gradients.rows[17]}, steps,
                            1e-3);
  }
}

TYPED_TEST(RasterExtremes, PrincipalPointsFarOutside) {
  for (double cx : {-1e6, 1e6, 1e15}) {
    Camera camera = this->camera();
    camera.cx = cx;
    expect_survival(this->scene(300), camera);
  }
}

TYPED_TEST(RasterExtremes, MapFarFromTheWorldsOrigin) {
  // As it should be: the origin carries the distance.
  auto map = this->scene(300);
  Camera camera = this->camera();
  const Eigen::Vector3d far(1e6, 1e6, 1e3);
  map.origin = far;
  camera.world_from_camera.translation() += far;
  const auto near = expect_survival(this->scene(300), this->camera());
  const auto moved = expect_survival(map, camera);
  EXPECT_EQ(moved.gradients.rows, near.gradients.rows);
  // And as it should not: the means do, rounded to 6 cm in float.
  map.origin.setZero();
  for (std::size_t i = 0; i < map.means.size(); ++i) {
    map.means[i] = TypeParam(double(map.means[i]) + far[Eigen::Index(i % 3)]);
  }
  expect_survival(map, camera);
}

TYPED_TEST(RasterExtremes, AllDepthsEqual) {
  const Camera camera = straight_camera(64, 48, 50);
  Random random(9);
  std::vector<Gaussian> gaussians(5000);
  for (Gaussian& g : gaussians) {
    g.mean = {random.uniform(-1.5, 1.5), random.uniform(-1, 1), 2};
    g.opacity = random.uniform(0.01, 0.99);
  }
  const auto map = map_of<TypeParam>(gaussians);
  RenderOptions of_centres;
  of_centres.surface_depth = false;
  const auto images = expect_survival(map, camera, of_centres).images;
  for (std::size_t i = 0; i < images.depth.size(); ++i) {
    ASSERT_NEAR(images.depth[i], images.alpha[i] > 0 ? 2 : 0, 1e-5);
  }
  expect_survival(map, camera);
  of_centres.alpha_min = without_jumps().alpha_min;
  of_centres.transmittance_min = without_jumps().transmittance_min;
  expect_spot_derivatives(map_of<TypeParam>({gaussians.begin(), gaussians.begin() + 9}), camera,
                          of_centres, {4}, {1e-7, 1e-5, 1e-5, 1e-5}, 1e-3);
}

TYPED_TEST(RasterExtremes, AHundredThousandGaussiansOnOnePixel) {
  const Camera camera = straight_camera(5, 5, 100);
  Random random(10);
  std::vector<Gaussian> gaussians(100000);
  for (Gaussian& g : gaussians) {
    const double z = random.uniform(1, 3);
    g.mean = {0, 0, z};
    g.scale_m.setConstant(0.002 * z);
    g.opacity = 1e-4;
    g.color = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
  }
  const auto map = map_of<TypeParam>(gaussians);
  RenderOptions options = without_jumps();
  const auto result = expect_survival(map, camera, options);
  // exp(-100,000 * 1e-4) of the light passes, but for the rounding of so many sums.
  EXPECT_NEAR(result.images.alpha[12], 1 - std::exp(-10.0), sizeof(TypeParam) == 4 ? 5e-4 : 1e-6);
  EXPECT_EQ(result.gradients.rows.size(), gaussians.size());
  // The step in depth must not change the order.
  gaussians.resize(10000);
  expect_spot_derivatives(map_of<TypeParam>(gaussians), camera, options, {77},
                          {1e-8, 1e-3, 1e-3, 1e-3}, 1e-3);
  // And with every one opaque, only the first few are seen.
  auto opaque = map;
  std::fill(opaque.logit_opacities.begin(), opaque.logit_opacities.end(), TypeParam(3));
  expect_survival(opaque, camera);
  expect_survival(opaque, camera, options);
}

}  // namespace
}  // namespace gslts::raster
