// Results depend on nothing but the arguments: not on the thread count, nor on what the object did.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_losses.hpp"
#include "raster_results.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

/// A view of a scene, and a loss on it.
template <typename T>
struct Job {
  Job(std::uint32_t seed, int width, int height, const SceneShape& shape, double mask_share = 1)
      : camera(tilted_camera(width, height)),
        map(converted<T>(random_scene(seed, camera, shape))),
        mask(random_mask(seed, camera, mask_share)),
        loss(random_loss<T>(seed, camera, shape.feature_dims)) {}

  Result<T> run(Rasterizer<T>& rasterizer, int threads = 2) const {
    RenderOptions options;
    options.threads = threads;
    options.near_sigmas = 0;
    options.background = {0.3, 0.2, 0.1};
    Result<T> result;
    result.images = rasterizer.forward(map.view(), camera, options, view_of(mask, camera));
    result.gradients = rasterizer.backward(map.view(), loss.gradients(), true);
    return result;
  }
  Result<T> run_fresh(int threads = 2) const {
    Rasterizer<T> rasterizer;
    return run(rasterizer, threads);
  }

  Camera camera;
  BasicGaussianMap<T> map;
  std::vector<std::uint8_t> mask;
  LinearLoss<T> loss;
};

SceneShape several_chunks() {
  SceneShape shape;
  shape.gaussians = 20000;
  shape.sh_bases = 4;
  shape.feature_dims = 3;
  shape.max_scale_px = 5;
  return shape;
}

template <typename T>
class RasterDeterminism : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterDeterminism, Scalars);

TYPED_TEST(RasterDeterminism, ThreadCountChangesNoBit) {
  for (double mask_share : {1.0, 0.02}) {
    const Job<TypeParam> job(1, 161, 110, several_chunks(), mask_share);
    const Result<TypeParam> single = job.run_fresh(1);
    ASSERT_GT(single.gradients.rows.size(), 5000u);
    for (int threads : {2, 3, 7, 0}) {
      SCOPED_TRACE(std::to_string(threads) + " threads");
      expect_identical(job.run_fresh(threads), single);
    }
  }
}

/// So many large splats that the image is rendered in bands.
TYPED_TEST(RasterDeterminism, ThreadCountChangesNoBitInBands) {
  SceneShape shape;
  shape.gaussians = 9000;
  shape.sh_bases = 1;
  shape.min_scale_px = 60;
  shape.max_scale_px = 300;
  shape.min_logit = -5;
  shape.max_logit = -2;
  const Job<TypeParam> job(2, 400, 390, shape, 0.05);
  const Result<TypeParam> single = job.run_fresh(1);
  ASSERT_GT(single.gradients.rows.size(), 7000u);
  for (int threads : {2, 3}) {
    SCOPED_TRACE(std::to_string(threads) + " threads");
    expect_identical(job.run_fresh(threads), single);
  }
}

TYPED_TEST(RasterDeterminism, AReusedObjectRemembersNothing) {
  SceneShape small, features;
  small.gaussians = 40;
  features.feature_dims = 33;
  features.sh_bases = 9;
  SceneShape none;
  none.gaussians = 0;
  const std::vector<Job<TypeParam>> jobs = {{3, 161, 110, several_chunks()},
                                            {4, 17, 9, small},
                                            {5, 70, 50, features, 0.3},
                                            {6, 30, 30, none},
                                            {7, 64, 64, small}};
  Rasterizer<TypeParam> reused;
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      SCOPED_TRACE("job " + std::to_string(i));
      expect_identical(jobs[i].run(reused), jobs[i].run_fresh());
    }
  }
}

TYPED_TEST(RasterDeterminism, BackwardCanBeRepeated) {
  const Job<TypeParam> job(8, 100, 80, several_chunks());
  Rasterizer<TypeParam> rasterizer;
  const Result<TypeParam> first = job.run(rasterizer);
  const auto other = random_loss<TypeParam>(9, job.camera, job.map.feature_dims, {true});
  rasterizer.backward(job.map.view(), other.gradients());
  Result<TypeParam> again = first;
  again.gradients = rasterizer.backward(job.map.view(), job.loss.gradients(), true);
  expect_identical(again, first);
}

TYPED_TEST(RasterDeterminism, StatisticsAreExtra) {
  const Job<TypeParam> job(10, 100, 80, several_chunks());
  Rasterizer<TypeParam> rasterizer;
  Result<TypeParam> with = job.run(rasterizer), without = with;
  without.gradients = rasterizer.backward(job.map.view(), job.loss.gradients());
  EXPECT_TRUE(without.gradients.abs_dL_dmeans2d.empty());
  EXPECT_TRUE(without.gradients.max_weights.empty());
  EXPECT_TRUE(without.gradients.pixel_counts.empty());
  with.gradients.abs_dL_dmeans2d.clear();
  with.gradients.max_weights.clear();
  with.gradients.pixel_counts.clear();
  expect_identical(without, with);
}

TYPED_TEST(RasterDeterminism, AMovedObjectGoesOn) {
  const Job<TypeParam> job(11, 60, 40, several_chunks());
  Rasterizer<TypeParam> first;
  Result<TypeParam> result = job.run(first);
  const Result<TypeParam> expected = result;
  Rasterizer<TypeParam> second = std::move(first);
  result.gradients = second.backward(job.map.view(), job.loss.gradients(), true);
  expect_identical(result, expected);
}

TYPED_TEST(RasterDeterminism, RowsAscend) {
  const Job<TypeParam> job(12, 100, 80, several_chunks());
  const auto rows = job.run_fresh().gradients.rows;
  for (std::size_t i = 1; i < rows.size(); ++i) ASSERT_LT(rows[i - 1], rows[i]);
  ASSERT_LT(rows.back(), job.map.size());
}

}  // namespace
}  // namespace gslts::raster
