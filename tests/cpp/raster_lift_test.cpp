// Lifting is the transpose of rendering features: with the weights as a matrix W, one row a pixel
// and one column a Gaussian, it returns W^T S and W^T 1.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_oracle.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;
using ::testing::HasSubstr;

template <typename T>
Array<T> random_features(std::uint32_t seed, const Camera& camera, int dims) {
  Random random(seed);
  Array<T> features(std::size_t(camera.width) * camera.height * dims);
  for (T& value : features) value = T(random.normal());
  return features;
}

/// The same map with one feature a Gaussian: rendering it gives the matrix of weights.
BasicGaussianMap<double> with_unit_features(BasicGaussianMap<double> map) {
  const std::size_t n = map.size();
  map.feature_dims = int(n);
  map.features.assign(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) map.features[i * n + i] = 1;
  return map;
}

template <typename T>
class RasterLift : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterLift, Scalars);

TYPED_TEST(RasterLift, IsTheTransposeOfRendering) {
  using T = TypeParam;
  const double tolerance = std::is_same_v<T, float> ? 2e-4 : 1e-9;
  // Channels below, at and above the widths of the vectors and of a pass.
  for (const int dims : {1, 3, 16, 32, 70}) {
    const Camera camera = tilted_camera(75, 44);
    SceneShape shape;
    shape.gaussians = 120;
    shape.sh_bases = 1;
    const auto map = random_scene(31, camera, shape);
    auto mask = random_mask(32, camera, 0.7);
    const auto oracle = render_oracle(with_unit_features(map), camera, {}, view_of(mask, camera));
    // Where rounding can flip a decision, the weights are not comparable.
    for (std::size_t p = 0; p < mask.size(); ++p) {
      mask[p] = mask[p] && oracle.alpha_margin[p] > 1e-3 && oracle.depth_margin[p] > 1e-5 &&
                oracle.transmittance_margin[p] > 1e-2;
    }
    ASSERT_GT(std::count(mask.begin(), mask.end(), 1), 1500);

    const auto features = random_features<T>(33, camera, dims);
    const auto same = converted<T>(map);
    Rasterizer<T> rasterizer;
    rasterizer.forward(same.view(), camera, {}, view_of(mask, camera));
    const LiftedFeatures<T> lifted = rasterizer.lift(same.view(), features.data(), dims);

    const std::size_t n = map.size(), depth = std::size_t(dims);
    std::vector<double> expected(n * depth, 0.0), weights(n, 0.0);
    for (std::size_t p = 0; p < mask.size(); ++p) {
      if (!mask[p]) continue;
      for (std::size_t g = 0; g < n; ++g) {
        const double w = oracle.images.features[p * n + g];
        weights[g] += w;
        for (std::size_t k = 0; k < depth; ++k) {
          expected[g * depth + k] += w * features[p * depth + k];
        }
      }
    }
    ASSERT_EQ(lifted.weights.size(), lifted.rows.size());
    ASSERT_EQ(lifted.weighted_features.size(), lifted.rows.size() * depth);
    for (std::size_t v = 0; v < lifted.rows.size(); ++v) {
      const std::size_t g = lifted.rows[v];
      if (v > 0) {
        ASSERT_LT(lifted.rows[v - 1], g);
      }
      ASSERT_NEAR(lifted.weights[v], weights[g], tolerance * (1 + weights[g]));
      for (std::size_t k = 0; k < depth; ++k) {
        ASSERT_NEAR(lifted.weighted_features[v * depth + k], expected[g * depth + k],
                    tolerance * (1 + weights[g]))
            << "Gaussian " << g << " channel " << k << " of " << dims;
      }
      weights[g] = 0;
    }
    EXPECT_THAT(weights, ::testing::Each(0.0)) << "seen by the oracle alone";
  }
}

TYPED_TEST(RasterLift, IsTheGradientOfFeatures) {
  using T = TypeParam;
  const Camera camera = tilted_camera(130, 90);
  SceneShape shape;
  shape.feature_dims = 5;
  const auto map = converted<T>(random_scene(41, camera, shape));
  const auto features = random_features<T>(42, camera, 5);
  Rasterizer<T> rasterizer;
  rasterizer.forward(map.view(), camera);
  ImageGradients<T> image;
  image.dL_dfeatures = features.data();
  const auto gradients = rasterizer.backward(map.view(), image);
  const auto lifted = rasterizer.lift(map.view(), features.data(), 5);
  EXPECT_EQ(lifted.rows, gradients.rows);
  for (std::size_t i = 0; i < lifted.weighted_features.size(); ++i) {
    ASSERT_NEAR(lifted.weighted_features[i], gradients.dL_dfeatures[i],
                1e-5 * (1 + std::abs(gradients.dL_dfeatures[i])));
  }
  // And it leaves the rendering as it was.
  EXPECT_EQ(rasterizer.backward(map.view(), image).dL_dfeatures, gradients.dL_dfeatures);
}

TYPED_TEST(RasterLift, DoesNotDependOnTheThreads) {
  using T = TypeParam;
  const Camera camera = tilted_camera(200, 150);
  SceneShape shape;
  shape.gaussians = 3000;
  const auto map = converted<T>(random_scene(51, camera, shape));
  const auto features = random_features<T>(52, camera, 33);
  LiftedFeatures<T> first;
  for (int threads : {1, 2, 5}) {
    RenderOptions options;
    options.threads = threads;
    Rasterizer<T> rasterizer;
    rasterizer.forward(map.view(), camera, options);
    const auto lifted = rasterizer.lift(map.view(), features.data(), 33);
    if (threads == 1) first = lifted;
    EXPECT_EQ(lifted.rows, first.rows);
    EXPECT_EQ(lifted.weighted_features, first.weighted_features);
    EXPECT_EQ(lifted.weights, first.weights);
  }
}

/// Lists too long for one band are made anew for the lifting.
TYPED_TEST(RasterLift, BandsFitTogether) {
  using T = TypeParam;
  const Camera camera = straight_camera(321, 287, 200);
  Random random(5);
  std::vector<Gaussian> gaussians(16000);
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    gaussians[i].mean = {random.uniform(-1, 1), random.uniform(-1, 1), 2 + 1e-4 * double(i)};
    gaussians[i].scale_m = {3, 3, 0.1};
    gaussians[i].opacity = 0.02;
  }
  const auto map = map_of<T>(gaussians);
  const Array<T> ones(std::size_t(321) * 287, T(1));
  Rasterizer<T> rasterizer;
  const auto images = rasterizer.forward(map.view(), camera);
  const auto lifted = rasterizer.lift(map.view(), ones.data(), 1);
  double weights = 0, features = 0, alpha = 0;
  for (T value : lifted.weights) weights += value;
  for (T value : lifted.weighted_features) features += value;
  for (T value : images.alpha) alpha += value;
  EXPECT_NEAR(weights / alpha, 1, 1e-5);
  EXPECT_NEAR(features / alpha, 1, 1e-5);
}

TYPED_TEST(RasterLift, NothingInViewIsNoRow) {
  using T = TypeParam;
  const auto map = make_gaussian_map<T>(0, 1);
  const Camera camera = tilted_camera(20, 10);
  const auto features = random_features<T>(1, camera, 4);
  Rasterizer<T> rasterizer;
  rasterizer.forward(map.view(), camera);
  const auto lifted = rasterizer.lift(map.view(), features.data(), 4);
  EXPECT_TRUE(lifted.rows.empty());
  EXPECT_TRUE(lifted.weights.empty());
}

TYPED_TEST(RasterLift, ErrorsNameWhatIsWrong) {
  using T = TypeParam;
  const Camera camera = tilted_camera(70, 60);
  const auto map = converted<T>(random_scene(61, camera, {}));
  auto features = random_features<T>(62, camera, 2);
  Rasterizer<T> rasterizer;
  const auto error = [&](int dims) -> std::string {
    try {
      rasterizer.lift(map.view(), features.data(), dims);
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(error(2), HasSubstr("Rasterizer::lift: there was no forward"));
  std::vector<std::uint8_t> mask(70 * 60, 1);
  mask[8 * 70 + 9] = 0;
  rasterizer.forward(map.view(), camera, {}, view_of(mask, camera));
  EXPECT_THAT(error(0), HasSubstr("Rasterizer::lift: dims must be at least 1, got 0"));
  features[2 * (8 * 70 + 9)] = std::numeric_limits<T>::quiet_NaN();  // Not wanted.
  EXPECT_EQ(error(2), "");
  features[2 * (8 * 70 + 10) + 1] = std::numeric_limits<T>::infinity();
  EXPECT_EQ(error(2), "Rasterizer::lift: features[8,10,1] is inf, must be finite");
}

}  // namespace
}  // namespace gslts::raster
