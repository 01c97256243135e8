// A map with bounds of its chunks renders to the same bits as one without, and is not read where
// nothing is in view.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_losses.hpp"
#include "raster_results.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

constexpr std::size_t kChunks = 12;
constexpr double kReachM = 20;

/// Chunks, each around a random centre; some Gaussians of one are larger than the scene.
template <typename T>
BasicGaussianMap<T> clustered_map(std::uint32_t seed) {
  Random random(seed);
  auto map = make_gaussian_map<T>(kChunks * kChunkSize - 100, 4, 2);
  double center[3] = {};
  for (std::size_t n = 0; n < map.size(); ++n) {
    const std::size_t chunk = n / kChunkSize;
    if (n % kChunkSize == 0) {
      for (double& x : center) x = random.uniform(-kReachM, kReachM);
    }
    const bool huge = chunk == 3 && n % 500 == 0;
    for (std::size_t i = 0; i < 3; ++i) {
      map.means[3 * n + i] = T(center[i] + 1.5 * random.normal());
      map.log_scales[3 * n + i] = T(random.uniform(-6, -2) + (huge ? random.uniform(0, 60) : 0));
    }
    const Eigen::Vector4d quat = random.quat();
    for (int i = 0; i < 4; ++i) map.quats[4 * n + std::size_t(i)] = T(quat[i]);
    map.logit_opacities[n] = T(random.uniform(-7, 2));
  }
  for (T& value : map.sh) value = T(0.4 * random.normal());
  for (T& value : map.features) value = T(random.normal());
  map.origin = {100, -20, 3};
  return map;
}

/// A camera anywhere in the scene or around it, with a principal point off the centre.
Camera random_camera(Random& random, const Eigen::Vector3d& origin) {
  Eigen::Vector3d eye, target;
  for (int i = 0; i < 3; ++i) {
    eye[i] = origin[i] + 1.5 * random.uniform(-kReachM, kReachM);
    target[i] = origin[i] + random.uniform(-kReachM, kReachM);
  }
  Eigen::Isometry3d pose = look_at(eye, target);
  pose.rotate(Eigen::AngleAxisd(random.uniform(-3, 3), Eigen::Vector3d::UnitZ()));
  Camera camera = camera_from_fov(80, 60, random.uniform(0.2, 2.6), pose);
  camera.cx += random.uniform(-30, 30);
  camera.fy *= random.uniform(0.7, 1.4);
  return camera;
}

template <typename T>
class Chunks : public ::testing::Test {};
using Precisions = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Chunks, Precisions);

TYPED_TEST(Chunks, BoundsChangeNoBit) {
  using T = TypeParam;
  Random random(5);
  Rasterizer<T> plain, bounded;
  int seen = 0;
  for (std::uint32_t trial = 0; trial < 40; ++trial) {
    const auto map = clustered_map<T>(trial % 4);
    const ChunkBounds bounds = chunk_bounds(map.view(), "test");
    GaussianView<T> view = map.view();
    view.bounds = &bounds;
    const Camera camera = random_camera(random, map.origin);
    const auto mask = random_mask(trial, camera, trial % 3 == 0 ? 0.01 : 1);
    const auto loss = random_loss<T>(trial, camera, map.feature_dims);
    RenderOptions options;
    options.near_sigmas = trial % 2 ? 0 : 3;
    options.alpha_min = trial % 5 ? 1.0 / 512 : 1e-20;
    options.eps2d_px2 = trial % 4 ? 0.3 : 0;
    options.near_m = trial % 7 ? 0.05 : 3;
    if (trial % 4 == 1) options.far_m = 12;
    options.threads = 1;
    Result<T> expected, got;
    expected.images = plain.forward(map.view(), camera, options, view_of(mask, camera));
    expected.gradients = plain.backward(map.view(), loss.gradients(), true);
    options.threads = 2;
    got.images = bounded.forward(view, camera, options, view_of(mask, camera));
    got.gradients = bounded.backward(view, loss.gradients(), true);
    expect_identical(expected, got);
    const auto a = plain.lift(map.view(), expected.images.rgb.data(), 3);
    const auto b = bounded.lift(view, got.images.rgb.data(), 3);
    EXPECT_EQ(a.rows, b.rows);
    EXPECT_EQ(a.weighted_features, b.weighted_features);
    EXPECT_EQ(a.weights, b.weights);
    seen += expected.gradients.rows.size() > 0;
    if (::testing::Test::HasFailure()) break;
  }
  EXPECT_GT(seen, 15);
}

TYPED_TEST(Chunks, ChunksOutOfViewAreNotRead) {
  using T = TypeParam;
  auto map = make_gaussian_map<T>(2 * kChunkSize, 1);
  for (std::size_t n = 0; n < map.size(); ++n) {
    const bool ahead = n < kChunkSize;
    map.means[3 * n] = map.means[3 * n + 1] = T(0.001 * double(n % 100));
    map.means[3 * n + 2] = ahead ? T(2) : T(-2);
    for (std::size_t i = 0; i < 3; ++i) map.log_scales[3 * n + i] = T(-4);
  }
  for (auto* array : {&map.quats, &map.logit_opacities, &map.sh}) {
    std::fill(array->begin(), array->end(), T(1));
  }
  const ChunkBounds bounds = chunk_bounds(map.view(), "test");
  GaussianView<T> view = map.view();
  view.bounds = &bounds;
  const Camera camera = straight_camera(64, 48, 50);
  map.sh.back() = std::numeric_limits<T>::quiet_NaN();
  Rasterizer<T> rasterizer;
  EXPECT_NO_THROW(rasterizer.forward(view, camera));
  EXPECT_THROW(rasterizer.forward(map.view(), camera), std::invalid_argument);
}

TYPED_TEST(Chunks, ChunksAreLoadedBeforeTheyAreRead) {
  using T = TypeParam;
  const auto whole = clustered_map<T>(2);
  ChunkBounds bounds = chunk_bounds(whole.view(), "test");
  auto map = whole;  // Its chunks are filled when they are asked for.
  for (auto* array : {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh}) {
    std::fill(array->begin(), array->end(), T(0));
  }
  std::vector<std::uint8_t> loaded(bounds.chunks.size());
  const auto copy = [&](const Array<T>& from, Array<T>& to, std::size_t chunk) {
    const std::size_t columns = from.size() / whole.size();
    const std::size_t begin = chunk * kChunkSize;
    const std::size_t end = std::min(begin + kChunkSize, whole.size());
    std::copy(from.begin() + begin * columns, from.begin() + end * columns,
              to.begin() + begin * columns);
  };
  bounds.load = [&](const std::vector<std::uint32_t>& chunks) {
    for (const std::uint32_t chunk : chunks) {
      copy(whole.means, map.means, chunk);
      copy(whole.quats, map.quats, chunk);
      copy(whole.log_scales, map.log_scales, chunk);
      copy(whole.logit_opacities, map.logit_opacities, chunk);
      copy(whole.sh, map.sh, chunk);
      loaded[chunk] = 1;
    }
  };
  GaussianView<T> view = map.view();
  view.bounds = &bounds;
  Random random(3);
  Rasterizer<T> plain, loading;
  for (int trial = 0; trial < 5; ++trial) {
    const Camera camera = random_camera(random, whole.origin);
    const Images<T> expected = plain.forward(whole.view(), camera);
    const Images<T> got = loading.forward(view, camera);
    EXPECT_EQ(expected.rgb, got.rgb);
    EXPECT_EQ(expected.depth, got.depth);
    if (trial == 0) {
      EXPECT_GT(std::count(loaded.begin(), loaded.end(), 0), 0);
    }
  }
  bounds.load = [](const std::vector<std::uint32_t>&) { throw std::runtime_error("damaged"); };
  EXPECT_THROW(loading.forward(view, random_camera(random, whole.origin)), std::runtime_error);
}

TYPED_TEST(Chunks, NothingInViewIsBackground) {
  using T = TypeParam;
  const auto map = clustered_map<T>(1);
  const ChunkBounds bounds = chunk_bounds(map.view(), "test");
  GaussianView<T> view = map.view();
  view.bounds = &bounds;
  const Eigen::Vector3d far = map.origin + Eigen::Vector3d(0, 0, 1e6);
  const Camera camera = camera_from_fov(64, 48, 0.5, look_at(far, far + Eigen::Vector3d(0, 1, 1)));
  Rasterizer<T> rasterizer;
  const Images<T> images = rasterizer.forward(view, camera);
  EXPECT_TRUE(std::all_of(images.alpha.begin(), images.alpha.end(), [](T a) { return a == 0; }));
  EXPECT_EQ(images.alpha, rasterizer.forward(map.view(), camera).alpha);
}

}  // namespace
}  // namespace gslts::raster
