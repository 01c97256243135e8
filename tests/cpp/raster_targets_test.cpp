// Every kernel gives the same bits on every instruction set with fused multiply-add.
//
// The scenes are made without a C library's functions, which may differ from machine to machine, so
// that one machine can compare with the bits of another: kExpected was written on x86-64.

#include "hwy/highway.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "gslts/align/normal_equations.hpp"
#include "gslts/optim/adam.hpp"
#include "gslts/optim/losses.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "gslts/simd/target.hpp"
#include "raster_losses.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace optim;
using namespace testing;

/// FNV-1a hash of the bits of arrays and numbers, by name.
class Bits {
 public:
  template <typename Values>
  void add(const std::string& name, const Values& values) {
    using Value = typename Values::value_type;
    std::uint64_t hash = 14695981039346656037u;
    for (const Value& value : values) {
      unsigned char bytes[sizeof(Value)];
      std::memcpy(bytes, &value, sizeof(Value));
      for (unsigned char byte : bytes) hash = (hash ^ byte) * 1099511628211u;
    }
    hashes_[name] = hash;
  }
  void add_number(const std::string& name, double value) { add(name, std::vector<double>{value}); }

  const std::map<std::string, std::uint64_t>& hashes() const { return hashes_; }
  /// Returns one hash of all of them.
  std::uint64_t combined() const {
    std::uint64_t combined = 0;
    for (const auto& [name, hash] : hashes_) combined = combined * 1099511628211u + hash;
    return combined;
  }

 private:
  std::map<std::string, std::uint64_t> hashes_;
};

/// Scene and options for one call of every kernel.
struct Case {
  std::uint32_t seed;
  int width, height;
  std::size_t gaussians;
  int sh_bases, feature_dims;
  double mask_share;  ///< 1: no mask.
  RenderOptions options;
};

RenderOptions with(int exp_degree, bool antialias, bool surface_depth, double alpha_min) {
  RenderOptions options;
  options.exp_degree = exp_degree;
  options.antialias = antialias;
  options.surface_depth = surface_depth;
  options.alpha_min = alpha_min;
  options.background = {0.3, 0.2, 0.1};
  return options;
}

/// Sizes that fill no vector, block or tile, and all that changes the arithmetic.
std::vector<Case> cases() {
  return {{1, 75, 49, 5000, 16, 0, 1, with(3, false, true, 1.0 / 512)},
          {2, 64, 32, 3000, 1, 5, 0.4, with(5, true, false, 1.0 / 255)},
          {3, 33, 41, 4500, 9, 17, 1, with(3, true, true, 1.0 / 100)},
          {4, 7, 3, 40, 4, 1, 1, with(5, false, true, 1e-30)},
          {5, 19, 16, 0, 1, 0, 0.5, with(3, false, false, 0.9)}};
}

/// A camera whose pose needs no sine: quarter turns about two axes and a rotation by (3, 4, 5).
Camera plain_camera(int width, int height) {
  Camera camera{0.8 * width, 0.75 * width, 0.45 * width, 0.55 * height, width, height, {}};
  camera.world_from_camera.setIdentity();
  Eigen::Matrix3d rotation;
  rotation << 0.6, 0, 0.8, 0, 1, 0, -0.8, 0, 0.6;
  camera.world_from_camera.linear() = rotation;
  camera.world_from_camera.translation() << 1.25, -0.5, 0.75;
  return camera;
}

/// Uniform numbers in place of normal ones and of logarithms.
template <typename T>
BasicGaussianMap<T> plain_scene(const Case& task, const Camera& camera) {
  Random random(task.seed);
  auto map = make_gaussian_map<T>(task.gaussians, task.sh_bases, task.feature_dims);
  const auto number = [&random](double low, double high) {
    return T(float(random.uniform(low, high)));
  };
  for (std::size_t n = 0; n < task.gaussians; ++n) {
    const double z = random.uniform(-0.5, 5), x = random.uniform(-4, 4), y = random.uniform(-3, 3);
    const Eigen::Matrix3d rotation = camera.world_from_camera.linear();
    for (int i = 0; i < 3; ++i) {
      const double place = camera.world_from_camera.translation()(i) + rotation(i, 0) * x;
      map.means[3 * n + i] = T(float(place + rotation(i, 1) * y + rotation(i, 2) * z));
      map.log_scales[3 * n + i] = number(-6, -1);
    }
    for (int i = 0; i < 4; ++i) map.quats[4 * n + i] = number(-1, 1);
    map.logit_opacities[n] = number(-4, 5);
  }
  for (T& value : map.sh) value = number(-0.6, 0.6);
  for (T& value : map.features) value = number(-1, 1);
  return map;
}

template <typename T>
Array<T> plain_numbers(std::uint32_t seed, std::size_t size, double low, double high) {
  Random random(seed);
  Array<T> numbers(size);
  for (T& value : numbers) value = T(float(random.uniform(low, high)));
  return numbers;
}

template <typename T>
void add_gradients(Bits& bits, const Gradients<T>& gradients) {
  bits.add("rows", gradients.rows);
  bits.add("dL_dmeans", gradients.dL_dmeans);
  bits.add("dL_dquats", gradients.dL_dquats);
  bits.add("dL_dlog_scales", gradients.dL_dlog_scales);
  bits.add("dL_dlogit_opacities", gradients.dL_dlogit_opacities);
  bits.add("dL_dsh", gradients.dL_dsh);
  bits.add("dL_dfeatures", gradients.dL_dfeatures);
  bits.add("dL_dtwist", gradients.dL_dtwist);
  bits.add("abs_dL_dmeans2d", gradients.abs_dL_dmeans2d);
  bits.add("max_weights", gradients.max_weights);
  bits.add("pixel_counts", gradients.pixel_counts);
}

template <typename T>
void add_losses(Bits& bits, const Case& task, const Images<T>& images, const Array<T>& photo,
                const Array<T>& measured, const PixelMask& mask) {
  const int width = task.width, height = task.height;
  const Exposure exposure = fit_exposure(images.rgb.data(), photo.data(), width, height, mask);
  bits.add("exposure gain", exposure.gain);
  bits.add("exposure offset", exposure.offset);
  const auto photometric =
      photometric_loss(images.rgb.data(), photo.data(), width, height, mask, 0.2, exposure, 1);
  bits.add_number("photometric loss", photometric.value);
  bits.add("photometric dL_drgb", photometric.dL_drgb);
  const auto depth = depth_loss(images.depth.data(), measured.data(), width, height, mask, true, 1);
  bits.add_number("depth loss", depth.value);
  bits.add("dL_ddepth", depth.dL_ddepth);
}

template <typename T>
Bits bits_of(const Case& task) {
  Bits bits;
  const Camera camera = plain_camera(task.width, task.height);
  BasicGaussianMap<T> map = plain_scene<T>(task, camera);
  const std::size_t pixels = std::size_t(task.width) * std::size_t(task.height);
  const std::vector<std::uint8_t> wanted = random_mask(task.seed, camera, task.mask_share);
  const PixelMask mask = task.mask_share < 1 ? view_of(wanted, camera) : PixelMask{};

  Rasterizer<T> rasterizer;
  const Images<T> images = rasterizer.forward(map.view(), camera, task.options, mask);
  bits.add("rgb", images.rgb);
  bits.add("depth", images.depth);
  bits.add("alpha", images.alpha);
  bits.add("features", images.features);

  const auto dL_drgb = plain_numbers<T>(7, 3 * pixels, -1, 1);
  const auto dL_ddepth = plain_numbers<T>(8, pixels, -1, 1);
  const auto dL_dalpha = plain_numbers<T>(9, pixels, -1, 1);
  const auto dL_dfeatures = plain_numbers<T>(10, pixels * task.feature_dims, -1, 1);
  const ImageGradients<T> losses = {dL_drgb.data(), dL_ddepth.data(), dL_dalpha.data(),
                                    task.feature_dims ? dL_dfeatures.data() : nullptr};
  const Gradients<T> gradients = rasterizer.backward(map.view(), losses, true);
  add_gradients(bits, gradients);

  const auto lifted =
      rasterizer.lift(map.view(), plain_numbers<T>(11, 67 * pixels, -1, 1).data(), 67);
  bits.add("lifted features", lifted.weighted_features);
  bits.add("lifted weights", lifted.weights);

  const auto photo = plain_numbers<T>(12, 3 * pixels, 0, 1);
  const auto measured = plain_numbers<T>(13, pixels, -1, 5);
  add_losses(bits, task, images, photo, measured, mask);

  const align::Alignment alignment = align::align(camera, images.rgb.data(), images.depth.data(),
                                                  photo.data(), measured.data(), mask);
  bits.add("alignment color", std::vector<double>(alignment.color.hessian.data(),
                                                  alignment.color.hessian.data() + 100));
  bits.add("alignment depth",
           std::vector<double>(alignment.depth.right.data(), alignment.depth.right.data() + 10));

  Adam<T> adam(map.size(), task.sh_bases, task.feature_dims);
  for (int step = 0; step < 3; ++step) {
    adam.step(map, gradients.view(), {1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-3, 1e-2});
  }
  bits.add("Adam means", map.means);
  bits.add("Adam quats", map.quats);
  bits.add("Adam sh", map.sh);
  bits.add("Adam second moments", adam.state().second);
  return bits;
}

/// Instruction sets with fused multiply-add that this machine can use.
std::vector<std::string> fused_targets() {
  std::vector<std::string> targets = simd::targets();
  targets.erase(std::remove(targets.begin(), targets.end(), "sse4"), targets.end());
  return targets;
}

/// Uses one instruction set while it lives, and the best of the machine afterwards.
class Using {
 public:
  explicit Using(const std::string& target) : before_(simd::target()) { simd::use_target(target); }
  ~Using() { simd::use_target(before_); }
  Using(const Using&) = delete;

 private:
  std::string before_;
};

template <typename T>
class RasterTargets : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterTargets, Scalars);

TYPED_TEST(RasterTargets, EveryKernelGivesTheSameBits) {
  const std::vector<std::string> targets = fused_targets();
  if (targets.size() < 2) GTEST_SKIP() << "this machine has one instruction set to compare";
  for (const Case& task : cases()) {
    SCOPED_TRACE("case " + std::to_string(task.seed));
    std::vector<Bits> all;
    for (const std::string& target : targets) {
      const Using use(target);
      ASSERT_EQ(simd::target(), target);
      all.push_back(bits_of<TypeParam>(task));
    }
    for (std::size_t i = 1; i < all.size(); ++i) {
      SCOPED_TRACE(targets[i] + " and " + targets[0]);
      EXPECT_EQ(all[i].hashes(), all[0].hashes());
    }
  }
}

/// The bits of the cases on x86-64, float and double.
constexpr std::uint64_t kExpected[2][5] = {
    {5791957973483694313u, 16279554790160848561u, 6562149615276352323u, 11010750147310234329u,
     6613800015899397693u},
    {4970315255661952259u, 6244513709658679138u, 14212633534383105802u, 14481300937515324809u,
     17412712458646012142u}};

TYPED_TEST(RasterTargets, EveryMachineGivesTheSameBits) {
#if HWY_MAJOR != 1 || HWY_MINOR != 0
  GTEST_SKIP() << "another version of Highway may compute exp in another way";
#endif
  const std::vector<std::string> targets = fused_targets();
  if (targets.empty()) GTEST_SKIP() << "this machine has no fused multiply-add";
  const Using use(targets[0]);
  for (const Case& task : cases()) {
    SCOPED_TRACE("case " + std::to_string(task.seed));
    EXPECT_EQ(bits_of<TypeParam>(task).combined(),
              kExpected[sizeof(TypeParam) == 8][task.seed - 1]);
  }
}

}  // namespace
}  // namespace gslts::raster
