// The statistics that guide densification and pruning, against the reference renderer.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_losses.hpp"
#include "raster_oracle.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

template <typename T>
class RasterStatistics : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterStatistics, Scalars);

TYPED_TEST(RasterStatistics, WeightsAndCountsMatchTheOracle) {
  const Camera camera = tilted_camera(101, 75);
  for (double mask_share : {1.0, 0.1}) {
    const auto scene = random_scene(51, camera, {});
    const auto map = converted<TypeParam>(scene);
    const auto mask = random_mask(52, camera, mask_share);
    const auto loss = random_loss<TypeParam>(53, camera, 0);
    Rasterizer<TypeParam> rasterizer;
    rasterizer.forward(map.view(), camera, precise_options(), view_of(mask, camera));
    const auto gradients = rasterizer.backward(map.view(), loss.gradients(), true);
    const OracleRender oracle = render_oracle(scene, camera, {}, view_of(mask, camera));

    std::vector<std::uint32_t> counts(map.size(), 0);
    std::vector<double> weights(map.size(), 0);
    ASSERT_EQ(gradients.pixel_counts.size(), gradients.rows.size());
    ASSERT_EQ(gradients.max_weights.size(), gradients.rows.size());
    for (std::size_t v = 0; v < gradients.rows.size(); ++v) {
      counts[gradients.rows[v]] = gradients.pixel_counts[v];
      weights[gradients.rows[v]] = double(gradients.max_weights[v]);
    }
    // In float a pixel on the rim may flip.
    const bool exact = sizeof(TypeParam) == sizeof(double);
    std::size_t flips = 0, total = 0;
    for (std::size_t row = 0; row < map.size(); ++row) {
      flips += std::size_t(std::abs(double(counts[row]) - double(oracle.pixel_counts[row])));
      total += oracle.pixel_counts[row];
      EXPECT_NEAR(weights[row], oracle.max_weights[row], exact ? 1e-12 : 1e-5) << row;
    }
    ASSERT_GT(total, 1000u);
    EXPECT_LE(flips, exact ? 0 : 1 + total / 5000);
  }
}

/// |dL/dmean2d| summed over pixels, each pixel's gradient by moving the centre in the image.
TEST(RasterStatisticsDouble, AbsoluteGradientsMatchFiniteDifferences) {
  const Camera camera = tilted_camera(23, 18);
  SceneShape shape;
  shape.gaussians = 9;
  shape.feature_dims = 2;
  shape.min_scale_px = 1;
  shape.max_scale_px = 5;
  RenderOptions options = precise_options();
  options.alpha_min = 1e-30;
  options.transmittance_min = 0;
  for (bool antialias : {false, true}) {
    options.antialias = antialias;
    const auto map = random_scene(54, camera, shape);
    const auto loss = random_loss<double>(55, camera, 2);
    Rasterizer<double> rasterizer;
    rasterizer.forward(map.view(), camera, options);
    const auto gradients = rasterizer.backward(map.view(), loss.gradients(), true);
    ASSERT_GE(gradients.rows.size(), 5u);
    ASSERT_EQ(gradients.abs_dL_dmeans2d.size(), 2 * gradients.rows.size());

    const auto pixel_losses = [&](const Images<double>& images) {
      std::vector<double> losses(images.alpha.size());
      for (std::size_t i = 0; i < losses.size(); ++i) {
        losses[i] = loss.depth[i] * images.depth[i] + loss.alpha[i] * images.alpha[i];
        for (std::size_t c = 0; c < 3; ++c)
          losses[i] += loss.rgb[3 * i + c] * images.rgb[3 * i + c];
        for (std::size_t k = 0; k < 2; ++k) {
          losses[i] += loss.features[2 * i + k] * images.features[2 * i + k];
        }
      }
      return losses;
    };
    constexpr double kStep = 1e-4;
    for (std::size_t v = 0; v < gradients.rows.size(); ++v) {
      for (int axis = 0; axis < 2; ++axis) {
        std::vector<std::vector<double>> losses;
        for (double step : {-kStep, kStep}) {
          std::vector<Eigen::Vector2d> offsets(map.size(), Eigen::Vector2d::Zero());
          offsets[gradients.rows[v]][axis] = step;
          losses.push_back(pixel_losses(render_oracle(map, camera, options, {}, offsets).images));
        }
        double sum = 0;
        for (std::size_t i = 0; i < losses[0].size(); ++i) {
          sum += std::abs(losses[1][i] - losses[0][i]) / (2 * kStep);
        }
        EXPECT_NEAR(gradients.abs_dL_dmeans2d[2 * v + std::size_t(axis)], sum, 1e-6 * (1 + sum));
      }
    }
  }
}

TYPED_TEST(RasterStatistics, AbsoluteGradientsAddUpOverThePixels) {
  const Camera camera = tilted_camera(9, 7);
  SceneShape shape;
  shape.gaussians = 30;
  const auto map = converted<TypeParam>(random_scene(56, camera, shape));
  const auto loss = random_loss<TypeParam>(57, camera, 0);
  Rasterizer<TypeParam> rasterizer;
  rasterizer.forward(map.view(), camera);
  const auto whole = rasterizer.backward(map.view(), loss.gradients(), true);
  std::vector<double> sums(whole.abs_dL_dmeans2d.size(), 0);
  for (std::size_t pixel = 0; pixel < 9 * 7; ++pixel) {
    auto single = loss;
    for (std::size_t i = 0; i < 9 * 7; ++i) {
      if (i == pixel) continue;
      for (std::size_t c = 0; c < 3; ++c) single.rgb[3 * i + c] = 0;
      single.depth[i] = single.alpha[i] = 0;
    }
    const auto part = rasterizer.backward(map.view(), single.gradients(), true);
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += double(part.abs_dL_dmeans2d[i]);
    // Not of the loss: where it was blended, and how strongly.
    EXPECT_EQ(part.pixel_counts, whole.pixel_counts);
    EXPECT_EQ(part.max_weights, whole.max_weights);
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    EXPECT_NEAR(double(whole.abs_dL_dmeans2d[i]), sums[i], 1e-5 * (1e-3 + sums[i])) << i;
  }
}

}  // namespace
}  // namespace gslts::raster
