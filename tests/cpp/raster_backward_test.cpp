// The gradients of the double kernel against finite differences of its forward pass, and those of
// the float kernel against the double one.

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_finite_differences.hpp"
#include "raster_losses.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

constexpr int kFeatureDims = 2;

/// Options under which the image is a smooth function of all parameters.
RenderOptions smooth_options() {
  RenderOptions options;
  options.near_sigmas = 0;
  options.alpha_min = 1e-30;
  options.transmittance_min = 0;
  options.background = {0.4, -0.3, 0.7};
  options.threads = 1;
  return options;
}

struct Case {
  std::string name;
  Outputs outputs = kAllOutputs;
  SceneShape shape{};
  RenderOptions options = smooth_options();
  double mask_share = 1;
  double dark = 0;  ///< Taken from the colours.
  Eigen::Vector3d origin{0, 0, 0};
};

std::vector<Case> make_cases() {
  SceneShape few;
  few.gaussians = 7;
  few.sh_bases = 4;
  few.feature_dims = kFeatureDims;
  few.min_scale_px = 2;
  few.max_scale_px = 7;
  few.min_depth_m = 1;
  few.max_depth_m = 3;
  few.min_logit = -2;
  few.max_logit = 2;
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, auto change) {
    Case c;
    c.name = name;
    c.shape = few;
    change(c);
    cases.push_back(c);
  };
  for (int bits = 1; bits < 16; ++bits) {
    const Outputs outputs{(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0, (bits & 8) != 0};
    const std::string name = std::string(outputs.rgb ? "Rgb" : "") +
                             (outputs.depth ? "Depth" : "") + (outputs.alpha ? "Alpha" : "") +
                             (outputs.features ? "Features" : "");
    add(name, [&](Case& c) { c.outputs = outputs; });
    add(name + "Antialias", [&](Case& c) {
      c.outputs = outputs;
      c.options.antialias = true;
      c.shape.min_scale_px = 0.3;
      c.shape.max_scale_px = 3;
    });
  }
  for (int degree : {0, 1, 2, 3}) {
    add("MapDegree" + std::to_string(degree),
        [&](Case& c) { c.shape.sh_bases = (degree + 1) * (degree + 1); });
    add("OptionDegree" + std::to_string(degree), [&](Case& c) {
      c.shape.sh_bases = 16;
      c.options.sh_degree = degree;
    });
  }
  add("Masked", [](Case& c) { c.mask_share = 0.3; });
  add("MaskedAntialias", [](Case& c) { c.mask_share = 0.3, c.options.antialias = true; });
  add("Opaque", [](Case& c) { c.shape.min_logit = 4.7, c.shape.max_logit = 9; });
  add("Dark", [](Case& c) { c.dark = 0.5; });
  add("DarkNotClamped", [](Case& c) { c.dark = 0.5, c.options.clamp_colors = false; });
  add("NoLowPass", [](Case& c) { c.options.eps2d_px2 = 0; });
  add("WideLowPassAntialias", [](Case& c) { c.options.eps2d_px2 = 3, c.options.antialias = true; });
  add("NoFeatures", [](Case& c) { c.shape.feature_dims = 0; });
  add("ManyFeatures", [](Case& c) { c.shape.feature_dims = 33; });
  add("FarOut", [](Case& c) { c.origin = {1e6, -1e6, 512}; });
  add("MoreThanALane", [](Case& c) { c.shape.gaussians = 19; });
  return cases;
}

class RasterBackward : public ::testing::TestWithParam<Case> {};

TEST_P(RasterBackward, MatchesFiniteDifferences) {
  const Case& c = GetParam();
  Camera camera = tilted_camera(26, 21);
  camera.cx += 3.5;
  camera.fy *= 1.2;
  camera.world_from_camera.translation() = Eigen::Vector3d(1.25, -0.75, 1.5);
  auto map = random_scene(11, camera, c.shape);
  for (double& value : map.sh) value = value * 0.5 - c.dark;
  map.origin = c.origin;
  camera.world_from_camera.translation() += c.origin;
  const auto mask = random_mask(12, camera, c.mask_share);
  const auto loss = random_loss<double>(13, camera, c.shape.feature_dims, c.outputs);
  FiniteDifferences fd;
  // Adding 1,000 km to the step rounds it.
  if (!c.origin.isZero()) fd.relative = 1e-5, fd.of_group = 1e-5;
  expect_gradients(map, camera, c.options, view_of(mask, camera), loss, fd);
}

INSTANTIATE_TEST_SUITE_P(Cases, RasterBackward, ::testing::ValuesIn(make_cases()),
                         [](const auto& tested) { return tested.param.name; });

/// Gaussians so far to the side that the Jacobian is evaluated elsewhere than at their centres.
TEST(RasterBackwardEdges, ClampedJacobian) {
  const Camera camera = straight_camera(24, 20, 20);
  std::vector<Gaussian> gaussians(5);
  Random random(21);
  const Eigen::Vector2d tangents[5] = {
      {1.6, 0.1}, {-1.5, 0.2}, {0.1, 1.3}, {-0.2, -1.4}, {1.5, -1.2}};
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    const double z = 1.5 + 0.3 * double(i);
    gaussians[i].mean = {z * tangents[i].x(), z * tangents[i].y(), z};
    gaussians[i].scale_m = {0.9, 0.7, 0.5};
    gaussians[i].quat_wxyz = random.quat();
    gaussians[i].opacity = 0.8;
    gaussians[i].color = {0.9, 0.4, 0.7};
  }
  const auto map = map_of<double>(gaussians, 4);
  for (bool antialias : {false, true}) {
    RenderOptions options = smooth_options();
    options.antialias = antialias;
    const auto images = Rasterizer<double>().forward(map.view(), camera, options);
    ASSERT_GT(*std::max_element(images.alpha.begin(), images.alpha.end()), 0.2);
    const auto loss = random_loss<double>(22, camera, 0);
    expect_gradients(map, camera, options, {}, loss);
  }
}

/// Alpha that is clamped to 0.99 does not depend on opacity or geometry; colour has a gradient.
TEST(RasterBackwardEdges, ClampedAlpha) {
  const Camera camera = straight_camera(3, 3, 100);
  Gaussian g;
  g.scale_m.setConstant(1);  // Flat over the image.
  g.opacity = 1 - 1e-6;
  g.color = {0.8, 0.6, 0.4};
  const auto map = map_of<double>({g});
  Rasterizer<double> rasterizer;
  const auto images = rasterizer.forward(map.view(), camera, smooth_options());
  for (double alpha : images.alpha) ASSERT_EQ(alpha, 0.99);
  const auto loss = random_loss<double>(23, camera, 0);
  const auto gradients = rasterizer.backward(map.view(), loss.gradients());
  ASSERT_EQ(gradients.rows.size(), 1u);
  EXPECT_EQ(gradients.dL_dlogit_opacities[0], 0);
  for (double value : gradients.dL_dlog_scales) EXPECT_EQ(value, 0);
  for (double value : gradients.dL_dsh) EXPECT_NE(value, 0);
  expect_gradients(map, camera, smooth_options(), {}, loss);
}

TEST(RasterBackwardEdges, ClampedColour) {
  const Camera camera = straight_camera(12, 12, 20);
  Gaussian g;
  g.color = {-0.5, 0.6, -2};
  g.scale_m = {0.3, 0.1, 0.2};
  const auto map = map_of<double>({g}, 4);
  const auto loss = random_loss<double>(24, camera, 0);
  Rasterizer<double> rasterizer;
  rasterizer.forward(map.view(), camera, smooth_options());
  const auto gradients = rasterizer.backward(map.view(), loss.gradients());
  for (std::size_t i = 0; i < gradients.dL_dsh.size(); ++i) {
    if (i % 3 == 1) continue;
    EXPECT_EQ(gradients.dL_dsh[i], 0) << i;
  }
  EXPECT_NE(gradients.dL_dsh[1], 0);
  expect_gradients(map, camera, smooth_options(), {}, loss);
}

TEST(RasterBackwardEdges, AShortQuaternionHasNoGradient) {
  const Camera camera = straight_camera(12, 12, 20);
  Gaussian g;
  g.mean = {0.2, 0.3, 2};
  g.scale_m = {0.3, 0.1, 0.2};
  g.quat_wxyz.setZero();
  const auto map = map_of<double>({g});
  Rasterizer<double> rasterizer;
  rasterizer.forward(map.view(), camera, smooth_options());
  const auto loss = random_loss<double>(25, camera, 0);
  const auto gradients = rasterizer.backward(map.view(), loss.gradients());
  ASSERT_EQ(gradients.rows.size(), 1u);
  for (double value : gradients.dL_dquats) EXPECT_EQ(value, 0);
  for (double value : gradients.dL_dlog_scales) EXPECT_NE(value, 0);
}

/// With the usual thresholds, away from their jumps.
TEST(RasterBackwardEdges, DefaultThresholds) {
  const Camera camera = tilted_camera(26, 21);
  SceneShape shape;
  shape.gaussians = 40;
  shape.sh_bases = 4;
  shape.min_scale_px = 1;
  shape.feature_dims = kFeatureDims;
  RenderOptions options;
  options.threads = 1;
  FiniteDifferences fd;
  fd.step = 2e-6;
  fd.relative = 1e-4;
  fd.of_group = 1e-4;
  fd.skipped_share = 0.05;
  for (std::uint32_t seed : {31u, 32u}) {
    const auto map = random_scene(seed, camera, shape);
    expect_gradients(map, camera, options, {}, random_loss<double>(seed, camera, kFeatureDims), fd);
  }
}

TEST(RasterBackwardEdges, UnusedShCoefficientsHaveNoGradient) {
  const Camera camera = tilted_camera(26, 21);
  const auto map = random_scene(33, camera, {});
  RenderOptions options;
  options.sh_degree = 1;
  Rasterizer<double> rasterizer;
  rasterizer.forward(map.view(), camera, options);
  const auto loss = random_loss<double>(1, camera, 0);
  const auto gradients = rasterizer.backward(map.view(), loss.gradients());
  ASSERT_GT(gradients.rows.size(), 10u);
  for (std::size_t i = 0; i < gradients.dL_dsh.size(); ++i) {
    if (i % 48 < 12) continue;
    ASSERT_EQ(gradients.dL_dsh[i], 0) << i;
  }
}

template <typename T>
class RasterBackwardTyped : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterBackwardTyped, Scalars);

TYPED_TEST(RasterBackwardTyped, NoLossHasNoGradient) {
  const Camera camera = tilted_camera(40, 30);
  SceneShape shape;
  shape.feature_dims = kFeatureDims;
  const auto map = converted<TypeParam>(random_scene(34, camera, shape));
  Rasterizer<TypeParam> rasterizer;
  rasterizer.forward(map.view(), camera);
  const auto gradients = rasterizer.backward(map.view(), {});
  ASSERT_GT(gradients.rows.size(), 10u);
  for (const auto& group : dense_gradients(gradients, map)) {
    for (double value : group) ASSERT_EQ(value, 0);
  }
  for (double value : gradients.dL_dtwist) EXPECT_EQ(value, 0);
}

/// Gradients of the loss at unwanted pixels are ignored.
TYPED_TEST(RasterBackwardTyped, MaskedPixelsTakeNoPart) {
  const Camera camera = tilted_camera(40, 30);
  const auto map = converted<TypeParam>(random_scene(35, camera, {}));
  const auto mask = random_mask(36, camera, 0.4);
  auto loss = random_loss<TypeParam>(37, camera, 0), zeroed = loss;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i]) continue;
    for (std::size_t c = 0; c < 3; ++c) zeroed.rgb[3 * i + c] = 0;
    zeroed.depth[i] = zeroed.alpha[i] = 0;
  }
  Rasterizer<TypeParam> rasterizer;
  RenderOptions options;
  options.background = {1, 2, 3};
  rasterizer.forward(map.view(), camera, options, view_of(mask, camera));
  const auto masked = rasterizer.backward(map.view(), loss.gradients());
  const auto expected = rasterizer.backward(map.view(), zeroed.gradients());
  EXPECT_EQ(masked.dL_dmeans, expected.dL_dmeans);
  EXPECT_EQ(masked.dL_dsh, expected.dL_dsh);
  EXPECT_EQ(masked.dL_dtwist, expected.dL_dtwist);
  // The whole image with the same zeros has the same gradient but for the order of its sums.
  rasterizer.forward(map.view(), camera, options);
  const auto whole = rasterizer.backward(map.view(), zeroed.gradients());
  const auto a = dense_gradients(masked, map), b = dense_gradients(whole, map);
  for (std::size_t group = 0; group < kGroups; ++group) {
    double largest = 0;
    for (double value : b[group]) largest = std::max(largest, std::abs(value));
    for (std::size_t i = 0; i < a[group].size(); ++i) {
      ASSERT_NEAR(a[group][i], b[group][i], 1e-5 * largest) << kGroupNames[group] << " " << i;
    }
  }
}

TEST(RasterBackwardFloat, MatchesDouble) {
  const Camera camera = tilted_camera(160, 120);
  for (bool antialias : {false, true}) {
    SceneShape shape;
    shape.gaussians = 2000;
    shape.feature_dims = 3;
    const auto map = random_scene(41, camera, shape);
    const auto float_map = converted<float>(map);
    RenderOptions options;
    options.antialias = antialias;
    Rasterizer<double> exact;
    exact.forward(map.view(), camera, options);
    const auto loss = random_loss<double>(42, camera, 3);
    const auto expected = exact.backward(map.view(), loss.gradients());
    Rasterizer<float> fast;
    fast.forward(float_map.view(), camera, options);
    const auto float_loss = random_loss<float>(42, camera, 3);
    const auto actual = fast.backward(float_map.view(), float_loss.gradients());
    const auto a = dense_gradients(actual, float_map), b = dense_gradients(expected, map);
    for (std::size_t group = 0; group < kGroups; ++group) {
      double error2 = 0, norm2 = 0;
      for (std::size_t i = 0; i < a[group].size(); ++i) {
        error2 += (a[group][i] - b[group][i]) * (a[group][i] - b[group][i]);
        norm2 += b[group][i] * b[group][i];
      }
      EXPECT_GT(norm2, 0);
      EXPECT_LT(std::sqrt(error2 / norm2), 1e-3) << kGroupNames[group];
    }
    double twist_error2 = 0, twist_norm2 = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      const double error = actual.dL_dtwist[i] - expected.dL_dtwist[i];
      twist_error2 += error * error;
      twist_norm2 += expected.dL_dtwist[i] * expected.dL_dtwist[i];
    }
    EXPECT_LT(std::sqrt(twist_error2 / twist_norm2), 1e-3);
  }
}

}  // namespace
}  // namespace gslts::raster
