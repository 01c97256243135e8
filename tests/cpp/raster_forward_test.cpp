// The kernels against the reference renderer: tight where no decision is near its threshold, and a
// bounded number of bounded differences where rounding may flip one.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_oracle.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

/// Tolerances for errors of rounding in an image.
struct Tolerance {
  double inside;         ///< Error of a number at a pixel with no decision near its threshold.
  double flipped;        ///< Error of a number at any pixel.
  double band;           ///< Margin below which a decision may flip.
  double depth_band;     ///< Likewise for the order of two depths.
  double flipped_share;  ///< Share of the pixels inside the band.
};
template <typename T>
constexpr Tolerance kTolerance = {};
template <>
constexpr Tolerance kTolerance<float> = {3e-5, 0.01, 1e-4, 2e-6, 0.01};
template <>
constexpr Tolerance kTolerance<double> = {1e-12, 1e-12, 1e-13, 1e-14, 0.0};

struct Case {
  std::string name;
  int width = 67, height = 45;
  SceneShape shape{};
  RenderOptions options = precise_options();
  Eigen::Vector2d principal_shift_px{0, 0};
  double focal_ratio = 1;  ///< fy / fx
  double mask_share = 1;
};

Camera camera_of(const Case& c) {
  Camera camera = tilted_camera(c.width, c.height);
  camera.cx += c.principal_shift_px.x();
  camera.cy += c.principal_shift_px.y();
  camera.fy *= c.focal_ratio;
  return camera;
}

std::vector<Case> make_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, auto change) {
    Case c;
    c.name = name;
    change(c);
    cases.push_back(c);
  };
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{
           {1, 1}, {3, 5}, {4, 4}, {31, 33}, {32, 32}, {64, 96}, {101, 1}, {1, 70}, {130, 97}}) {
    add("Size" + std::to_string(width) + "x" + std::to_string(height), [&](Case& c) {
      c.width = width;
      c.height = height;
    });
  }
  for (int degree = 0; degree <= 3; ++degree) {
    add("MapDegree" + std::to_string(degree),
        [&](Case& c) { c.shape.sh_bases = (degree + 1) * (degree + 1); });
    add("OptionDegree" + std::to_string(degree), [&](Case& c) { c.options.sh_degree = degree; });
  }
  for (int dims : {1, 3, 32, 33}) {
    add("Features" + std::to_string(dims), [&](Case& c) { c.shape.feature_dims = dims; });
  }
  add("Background", [](Case& c) { c.options.background = {0.2, 1.5, -0.3}; });
  add("ColoursBelowZero", [](Case& c) { c.options.clamp_colors = false; });
  add("Antialias", [](Case& c) {
    c.options.antialias = true;
    c.shape.min_scale_px = 0.05;
  });
  add("NoLowPass", [](Case& c) {
    c.options.eps2d_px2 = 0;
    c.shape.min_scale_px = 0.5;
  });
  add("WideLowPass", [](Case& c) { c.options.eps2d_px2 = 4; });
  add("FarPlane", [](Case& c) { c.options.far_m = 3; });
  add("FarNearPlane", [](Case& c) { c.options.near_m = 2; });
  add("PrincipalPointOffCentre", [](Case& c) { c.principal_shift_px = {20, -14}; });
  add("PrincipalPointOutside", [](Case& c) { c.principal_shift_px = {-60, 40}; });
  add("PixelsNotSquare", [](Case& c) { c.focal_ratio = 1.7; });
  add("LowAlphaMin", [](Case& c) { c.options.alpha_min = 1e-9; });
  add("HighAlphaMin", [](Case& c) { c.options.alpha_min = 0.1; });
  add("NoEarlyEnd", [](Case& c) { c.options.transmittance_min = 0; });
  add("EarlyEnd", [](Case& c) { c.options.transmittance_min = 0.5; });
  add("Opaque", [](Case& c) { c.shape.min_logit = 4, c.shape.max_logit = 12; });
  add("Crowded", [](Case& c) {
    c.shape.gaussians = 1500;
    c.shape.max_scale_px = 4;
  });
  // One tile with a list several times as long as what is blended at once.
  for (int dims : {0, 9}) {
    add("LongList" + std::to_string(dims), [&](Case& c) {
      c.width = c.height = 32;
      c.shape.gaussians = 3000;
      c.shape.feature_dims = dims;
      c.shape.max_scale_px = 0.7;
      c.shape.max_logit = -1;
    });
  }
  // Centres outside the image, of which only the rims are seen.
  add("FarOutsideTheImage", [](Case& c) {
    c.shape.outside = 0.9;
    c.shape.gaussians = 100;
    c.shape.min_scale_px = c.shape.max_scale_px = 12;
    c.shape.min_logit = 3;
  });
  add("HalfMasked", [](Case& c) { c.mask_share = 0.5, c.options.background = {1, 2, 3}; });
  add("MostlyMasked", [](Case& c) { c.mask_share = 0.01, c.options.background = {1, 2, 3}; });
  return cases;
}

/// Compares an image with the oracle's; `scale` are the units of its numbers.
template <typename T>
void expect_image(const char* name, const Array<T>& image, const Array<double>& expected,
                  std::size_t channels, double scale, const std::vector<char>& in_band) {
  ASSERT_EQ(image.size(), expected.size()) << name;
  const Tolerance tolerance = kTolerance<T>;
  double worst_inside = 0, worst = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    ASSERT_TRUE(std::isfinite(image[i])) << name << " at " << i;
    const double error = std::abs(double(image[i]) - expected[i]);
    worst = std::max(worst, error);
    if (!in_band[i / channels]) worst_inside = std::max(worst_inside, error);
  }
  EXPECT_LE(worst_inside, tolerance.inside * scale) << name;
  EXPECT_LE(worst, tolerance.flipped * scale) << name;
}

template <typename T>
void expect_like_oracle(const Images<T>& images, const OracleRender& oracle, double depth_scale) {
  const Tolerance tolerance = kTolerance<T>;
  std::vector<char> in_band(oracle.alpha_margin.size());
  for (std::size_t i = 0; i < in_band.size(); ++i) {
    in_band[i] = oracle.alpha_margin[i] < tolerance.band ||
                 oracle.transmittance_margin[i] < tolerance.band ||
                 oracle.depth_margin[i] < tolerance.depth_band;
  }
  const auto flips = std::count(in_band.begin(), in_band.end(), 1);
  EXPECT_LE(double(flips), 1 + tolerance.flipped_share * double(in_band.size()));
  EXPECT_EQ(images.width, oracle.images.width);
  EXPECT_EQ(images.height, oracle.images.height);
  EXPECT_EQ(images.feature_dims, oracle.images.feature_dims);
  expect_image("rgb", images.rgb, oracle.images.rgb, 3, 1, in_band);
  expect_image("alpha", images.alpha, oracle.images.alpha, 1, 1, in_band);
  expect_image("depth", images.depth, oracle.images.depth, 1, depth_scale, in_band);
  if (images.feature_dims > 0) {
    expect_image("features", images.features, oracle.images.features,
                 std::size_t(images.feature_dims), 2, in_band);
  }
}

class RasterForward : public ::testing::TestWithParam<Case> {
 protected:
  template <typename T>
  void check() {
    const Case& c = GetParam();
    const Camera camera = camera_of(c);
    for (std::uint32_t seed : {1u, 2u}) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      const auto scene = random_scene(seed, camera, c.shape);
      const auto mask = random_mask(seed, camera, c.mask_share);
      const PixelMask mask_view = c.mask_share < 1 ? view_of(mask, camera) : PixelMask{};
      const auto map = converted<T>(scene);
      const Images<T> images = Rasterizer<T>().forward(map.view(), camera, c.options, mask_view);
      const OracleRender oracle = render_oracle(scene, camera, c.options, mask_view);
      expect_like_oracle(images, oracle, c.shape.max_depth_m);
    }
  }
};

TEST_P(RasterForward, FloatMatchesOracle) { check<float>(); }
TEST_P(RasterForward, DoubleMatchesOracle) { check<double>(); }

INSTANTIATE_TEST_SUITE_P(Cases, RasterForward, ::testing::ValuesIn(make_cases()),
                         [](const auto& tested) { return tested.param.name; });

template <typename T>
class RasterForwardTyped : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterForwardTyped, Scalars);

TYPED_TEST(RasterForwardTyped, NoGaussiansLeaveTheBackground) {
  const Camera camera = tilted_camera(37, 21);
  RenderOptions options;
  options.background = {0.25, 0.5, 1};
  const auto map = make_gaussian_map<TypeParam>(0, 4, 2);
  const auto images = Rasterizer<TypeParam>().forward(map.view(), camera, options);
  ASSERT_EQ(images.rgb.size(), 3u * 37 * 21);
  ASSERT_EQ(images.depth.size(), 37u * 21);
  ASSERT_EQ(images.features.size(), 2u * 37 * 21);
  for (std::size_t i = 0; i < images.rgb.size(); ++i) {
    ASSERT_EQ(images.rgb[i], TypeParam(options.background[i % 3]));
  }
  for (TypeParam value : images.depth) ASSERT_EQ(value, 0);
  for (TypeParam value : images.alpha) ASSERT_EQ(value, 0);
  for (TypeParam value : images.features) ASSERT_EQ(value, 0);
}

/// Gaussians that the camera does not see must not shift the rows of those it does.
TYPED_TEST(RasterForwardTyped, CulledRowsBeforeVisibleOnesChangeNothing) {
  const Camera camera = tilted_camera(64, 48);
  SceneShape shape;
  shape.behind = 0;
  shape.feature_dims = 3;
  const auto visible = random_scene(3, camera, shape);
  shape.behind = 1;
  shape.gaussians = 5000;  // More than a chunk.
  auto both = converted<TypeParam>(random_scene(4, camera, shape));
  const auto append = [](Array<TypeParam>& to, const Array<double>& from) {
    for (double value : from) to.push_back(TypeParam(value));
  };
  append(both.means, visible.means);
  append(both.quats, visible.quats);
  append(both.log_scales, visible.log_scales);
  append(both.logit_opacities, visible.logit_opacities);
  append(both.sh, visible.sh);
  append(both.features, visible.features);
  const auto alone = Rasterizer<TypeParam>().forward(converted<TypeParam>(visible).view(), camera,
                                                     precise_options());
  const auto images = Rasterizer<TypeParam>().forward(both.view(), camera, precise_options());
  EXPECT_EQ(images.rgb, alone.rgb);
  EXPECT_EQ(images.depth, alone.depth);
  EXPECT_EQ(images.features, alone.features);
  expect_like_oracle(images, render_oracle(visible, camera), shape.max_depth_m);
}

TYPED_TEST(RasterForwardTyped, EqualDepthsAreBlendedInTheOrderOfTheRows) {
  const Camera camera = straight_camera(40, 40, 40);
  Random random(5);
  std::vector<Gaussian> gaussians;
  for (int i = 0; i < 200; ++i) {
    Gaussian g;
    g.mean = {random.uniform(-1, 1), random.uniform(-1, 1), i % 3 == 0 ? 2.0 : 3.0};
    g.opacity = random.uniform(0.2, 0.9);
    g.scale_m.setConstant(0.2);
    g.color = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
    gaussians.push_back(g);
  }
  const auto map = map_of<TypeParam>(gaussians);
  const auto images = Rasterizer<TypeParam>().forward(map.view(), camera, precise_options());
  expect_like_oracle(images, render_oracle(converted<double>(map), camera), 3);
}

/// The pixels rendered with a mask equal those of the whole image, bit for bit.
TYPED_TEST(RasterForwardTyped, MaskedPixelsAreThoseOfTheWholeImage) {
  const Camera camera = tilted_camera(75, 53);
  SceneShape shape;
  shape.feature_dims = 2;
  const auto map = converted<TypeParam>(random_scene(6, camera, shape));
  RenderOptions options;
  options.background = {0.1, 0.2, 0.3};
  Rasterizer<TypeParam> rasterizer;
  const auto whole = rasterizer.forward(map.view(), camera, options);
  std::vector<std::vector<std::uint8_t>> masks;
  for (double share : {0.0, 0.003, 0.5, 1.0}) masks.push_back(random_mask(7, camera, share));
  masks.push_back(random_mask(7, camera, 0));
  for (int y = 30; y < 47; ++y) {
    for (int x = 9; x < 50; ++x) masks.back()[std::size_t(y) * 75 + std::size_t(x)] = 200;
  }
  for (const auto& mask : masks) {
    const auto images = rasterizer.forward(map.view(), camera, options, view_of(mask, camera));
    for (std::size_t i = 0; i < mask.size(); ++i) {
      const bool wanted = mask[i] != 0;
      for (std::size_t c = 0; c < 3; ++c) {
        ASSERT_EQ(images.rgb[3 * i + c], wanted ? whole.rgb[3 * i + c] : TypeParam(0)) << i;
      }
      ASSERT_EQ(images.depth[i], wanted ? whole.depth[i] : TypeParam(0)) << i;
      ASSERT_EQ(images.alpha[i], wanted ? whole.alpha[i] : TypeParam(0)) << i;
      for (std::size_t c = 0; c < 2; ++c) {
        ASSERT_EQ(images.features[2 * i + c], wanted ? whole.features[2 * i + c] : TypeParam(0));
      }
    }
  }
}

TYPED_TEST(RasterForwardTyped, AMapFarOutLooksTheSameBitForBit) {
  Camera camera = tilted_camera(64, 48);
  // Multiples of 2^-10 m: they stay exact when the 1,000 km are added.
  camera.world_from_camera.translation() = Eigen::Vector3d(1.25, -0.75, 1.40625);
  auto map = converted<TypeParam>(random_scene(8, camera, {}));
  const auto near = Rasterizer<TypeParam>().forward(map.view(), camera);
  const Eigen::Vector3d shift(1e6, -1e6, 512);
  map.origin = shift;
  camera.world_from_camera.translation() += shift;
  const auto far = Rasterizer<TypeParam>().forward(map.view(), camera);
  EXPECT_EQ(near.rgb, far.rgb);
  EXPECT_EQ(near.depth, far.depth);
  EXPECT_EQ(near.alpha, far.alpha);
}

/// Degree 3 errs by up to 8e-5 of each alpha, in float alone.
TEST(RasterExp, DegreesAgreeToTheirErrors) {
  const Camera camera = tilted_camera(90, 70);
  const auto map = random_scene(71, camera, {});
  const auto difference = [&](auto same) {
    using T = std::decay_t<decltype(same.means[0])>;
    RenderOptions options = precise_options();
    // Without thresholds no alpha can flip.
    options.alpha_min = 1e-30;
    options.transmittance_min = 0;
    Rasterizer<T> rasterizer;
    const auto fine = rasterizer.forward(same.view(), camera, options).rgb;
    options.exp_degree = 3;
    const auto coarse = rasterizer.forward(same.view(), camera, options).rgb;
    double worst = 0;
    for (std::size_t i = 0; i < fine.size(); ++i) {
      worst = std::max(worst, double(std::abs(fine[i] - coarse[i])));
    }
    return worst;
  };
  EXPECT_EQ(difference(map), 0);
  const double in_float = difference(converted<float>(map));
  EXPECT_GT(in_float, 1e-6);
  EXPECT_LT(in_float, 2e-4);
}

}  // namespace
}  // namespace gslts::raster
