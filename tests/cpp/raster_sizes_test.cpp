// Images and maps from nothing to very large, and the memory that they take.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "raster_extremes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

/// Largest resident size of the process since `reset_peak_memory`, bytes; 0 where the system does
/// not tell.
double peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes * 1024;
  }
  return 0;
}

void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }

template <typename T>
class RasterSizes : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterSizes, Scalars);

TYPED_TEST(RasterSizes, NoGaussiansHaveNoGradients) {
  const auto gradients =
      expect_survival(make_gaussian_map<TypeParam>(0, 9, 2), tilted_camera(20, 10)).gradients;
  EXPECT_TRUE(gradients.rows.empty());
  EXPECT_TRUE(gradients.dL_dmeans.empty());
  EXPECT_TRUE(gradients.dL_dsh.empty());
  EXPECT_TRUE(gradients.dL_dfeatures.empty());
  for (double value : gradients.dL_dtwist) EXPECT_EQ(value, 0);
}

TYPED_TEST(RasterSizes, NoneInView) {
  SceneShape shape;
  shape.behind = 1;
  const Camera camera = tilted_camera(20, 10);
  const auto map = converted<TypeParam>(random_scene(1, camera, shape));
  const auto gradients = expect_survival(map, camera).gradients;
  EXPECT_TRUE(gradients.rows.empty());
  for (double value : gradients.dL_dtwist) EXPECT_EQ(value, 0);
}

TYPED_TEST(RasterSizes, ThinImages) {
  for (const auto& [width, height] :
       {std::pair(1, 1), {1, 333}, {333, 1}, {1, 65536}, {65536, 1}}) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    Camera camera = tilted_camera(width, height);
    camera.fx = camera.fy = 0.5 * std::max(width, height);
    SceneShape shape;
    shape.gaussians = 200;
    shape.sh_bases = 4;
    const auto map = converted<TypeParam>(random_scene(2, camera, shape));
    const auto gradients = expect_survival(map, camera, without_jumps()).gradients;
    EXPECT_GT(gradients.rows.size(), 20u);
  }
  Camera camera = straight_camera(1, 1, 20);
  Gaussian g;
  g.mean = {0.01, -0.02, 2};
  const auto map = map_of<TypeParam>({g}, 4);
  expect_spot_derivatives(map, camera, without_jumps(), {0});
}

/// A small Gaussian in the middle of each corner pixel, and one behind that covers everything.
std::vector<Gaussian> corners_and_all(const Camera& camera) {
  std::vector<Gaussian> gaussians;
  for (double x : {0.5, camera.width - 0.5}) {
    for (double y : {0.5, camera.height - 0.5}) {
      Gaussian g;
      g.mean = {(x - camera.cx) / camera.fx * 2, (y - camera.cy) / camera.fy * 2, 2};
      g.scale_m.setConstant(1 / camera.fx);
      gaussians.push_back(g);
    }
  }
  Gaussian everywhere;
  everywhere.mean = {0, 0, 100};
  everywhere.scale_m = {3000, 3000, 10};
  everywhere.opacity = 0.1;
  gaussians.push_back(everywhere);
  return gaussians;
}

TYPED_TEST(RasterSizes, LargeImages) {
  const int width = 8192, height = 512;
  const Camera camera = straight_camera(width, height, 4000);
  const auto map = map_of<TypeParam>(corners_and_all(camera));
  Rasterizer<TypeParam> rasterizer;
  const auto images = rasterizer.forward(map.view(), camera);
  const auto alpha_at = [&](int x, int y) {
    return images.alpha[std::size_t(y) * std::size_t(width) + std::size_t(x)];
  };
  for (int x : {0, width - 1}) {
    for (int y : {0, height - 1}) EXPECT_NEAR(alpha_at(x, y), 0.5 + 0.5 * 0.1, 1e-3);
  }
  EXPECT_NEAR(alpha_at(width / 2, height / 2), 0.1, 1e-4);
  EXPECT_TRUE(all_finite(images.rgb));
  EXPECT_TRUE(all_finite(images.depth));

  // Only alpha in the loss, and only one corner: only the Gaussian there, and the one behind it.
  Array<TypeParam> dL_dalpha(images.alpha.size());
  std::fill(dL_dalpha.begin(), dL_dalpha.end(), TypeParam(0));
  dL_dalpha.back() = 1;
  ImageGradients<TypeParam> image_gradients;
  image_gradients.dL_dalpha = dL_dalpha.data();
  const auto gradients = rasterizer.backward(map.view(), image_gradients, true);
  ASSERT_EQ(gradients.rows.size(), 5u);
  for (std::size_t n = 0; n < 3; ++n) EXPECT_EQ(gradients.dL_dlogit_opacities[n], 0) << n;
  EXPECT_NEAR(gradients.dL_dlogit_opacities[3], 0.25 * 0.9, 1e-3);
  EXPECT_NEAR(gradients.dL_dlogit_opacities[4], 0.09 * 0.5, 1e-3);
  EXPECT_EQ(gradients.pixel_counts[4], std::uint32_t(width) * std::uint32_t(height));
}

/// 67 million pixels: no offset may be kept in too few bits.
TEST(RasterSizesFloat, VeryLargeImages) {
  const int size = 8192;
  const Camera camera = straight_camera(size, size, 4000);
  auto corners = corners_and_all(camera);
  corners.pop_back();
  const auto map = map_of<float>(corners);
  Rasterizer<float> rasterizer;
  RenderOptions of_centres;
  of_centres.surface_depth = false;
  const auto images = rasterizer.forward(map.view(), camera, of_centres);
  std::size_t seen = 0;
  for (float alpha : images.alpha) seen += alpha > 0;
  EXPECT_GT(seen, 4 * 7u);
  EXPECT_LT(seen, 4 * 40u);
  for (std::size_t y : {0, size - 1}) {
    for (std::size_t x : {0, size - 1}) EXPECT_NEAR(images.alpha[y * size + x], 0.5, 1e-3);
  }
  Array<float> dL_ddepth(images.alpha.size());
  std::fill(dL_ddepth.begin(), dL_ddepth.end(), 1.0f);
  ImageGradients<float> image_gradients;
  image_gradients.dL_ddepth = dL_ddepth.data();
  const auto gradients = rasterizer.backward(map.view(), image_gradients, true);
  ASSERT_EQ(gradients.rows.size(), 4u);
  for (std::size_t n = 0; n < 4; ++n) {
    // Alone at its pixels, a Gaussian's depth is its own: dL/dz counts them.
    EXPECT_NEAR(gradients.dL_dmeans[3 * n + 2], float(gradients.pixel_counts[n]), 1e-2);
  }
}

/// 20,000 Gaussians that each cover all of the image would fill 6 million places in the lists of
/// the tiles and as many in the buffers of their gradients: half a gigabyte and more.
TYPED_TEST(RasterSizes, MemoryIsBoundedWhenEverythingCoversEverything) {
  const Camera camera = straight_camera(640, 480, 400);
  Random random(3);
  std::vector<Gaussian> gaussians(20000);
  for (Gaussian& g : gaussians) {
    g.mean = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4)};
    g.scale_m = {50, 50, 0.5};
    g.opacity = 0.02;
    g.color = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
  }
  const auto map = map_of<TypeParam>(gaussians);
  const auto loss = random_loss<TypeParam>(4, camera, 0);
  Rasterizer<TypeParam> rasterizer;
  reset_peak_memory();
  const double before = peak_memory_bytes();
  const auto images = rasterizer.forward(map.view(), camera);
  const auto gradients = rasterizer.backward(map.view(), loss.gradients(), true);
  EXPECT_LT(peak_memory_bytes() - before, 300e6);
  EXPECT_TRUE(all_finite(images.rgb));
  EXPECT_TRUE(all_finite(gradients.dL_dmeans));
  ASSERT_EQ(gradients.rows.size(), gaussians.size());
  // Each pixel ends at the first Gaussian that would leave less than 1e-4 of the light.
  for (TypeParam alpha : images.alpha) {
    ASSERT_GE(alpha, 1 - 1e-4 / 0.98 - 2e-5);
    ASSERT_LE(alpha, 1 - 1e-4 + 2e-5);
  }
}

/// Rendered in bands, an image is that of its parts.
TYPED_TEST(RasterSizes, BandsFitTogether) {
  const Camera camera = straight_camera(321, 287, 200);
  Random random(5);
  std::vector<Gaussian> gaussians(16000);
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    Gaussian& g = gaussians[i];
    g.mean = {random.uniform(-1, 1), random.uniform(-1, 1), 2 + 1e-4 * double(i)};
    g.scale_m.setConstant(0.05);
    if (i % 8 != 0) g.scale_m.head<2>().setConstant(3);
    g.opacity = 0.02;
    g.color = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
  }
  // Only the first thousands shine through; fewer of them need no bands.
  const auto all = map_of<TypeParam>(gaussians);
  gaussians.resize(4000);
  const auto front = map_of<TypeParam>(gaussians);
  RenderOptions options;
  options.transmittance_min = 0.2;
  const auto loss = random_loss<TypeParam>(6, camera, 0);
  Rasterizer<TypeParam> rasterizer;
  const auto banded = rasterizer.forward(all.view(), camera, options);
  const auto banded_gradients = rasterizer.backward(all.view(), loss.gradients(), true);
  const auto whole = rasterizer.forward(front.view(), camera, options);
  const auto whole_gradients = rasterizer.backward(front.view(), loss.gradients(), true);
  EXPECT_EQ(banded.rgb, whole.rgb);
  EXPECT_EQ(banded.depth, whole.depth);
  EXPECT_EQ(banded.alpha, whole.alpha);
  const auto a = dense_gradients(banded_gradients, all);
  const auto b = dense_gradients(whole_gradients, front);
  for (std::size_t group = 0; group < kGroups; ++group) {
    for (std::size_t i = 0; i < b[group].size(); ++i) {
      ASSERT_EQ(a[group][i], b[group][i]) << kGroupNames[group] << " " << i;
    }
    for (std::size_t i = b[group].size(); i < a[group].size(); ++i) ASSERT_EQ(a[group][i], 0);
  }
  for (std::size_t v = 0; v < whole_gradients.rows.size(); ++v) {
    ASSERT_EQ(banded_gradients.rows[v], whole_gradients.rows[v]);
    ASSERT_EQ(banded_gradients.pixel_counts[v], whole_gradients.pixel_counts[v]);
    ASSERT_EQ(banded_gradients.max_weights[v], whole_gradients.max_weights[v]);
  }
}

}  // namespace
}  // namespace gslts::raster
