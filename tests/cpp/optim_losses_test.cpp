// The losses of images against readable references and finite differences.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gslts/optim/losses.hpp"
#include "raster_scenes.hpp"

namespace gslts::optim {
namespace {

using raster::testing::Random;
using ::testing::HasSubstr;

template <typename T>
struct ImagePair {
  int width = 0, height = 0;
  Array<T> rgb, target;
  std::vector<std::uint8_t> wanted;  ///< Empty: all.

  PixelMask mask() const {
    return wanted.empty() ? PixelMask{} : PixelMask{wanted.data(), width, height};
  }
  bool is_wanted(int x, int y) const { return wanted.empty() || wanted[y * width + x]; }
};

/// Smooth images with noise and flat parts; `mask_share` of the pixels are wanted.
template <typename T>
ImagePair<T> random_images(std::uint32_t seed, int width, int height, double mask_share = 1) {
  Random random(seed);
  ImagePair<T> images;
  images.width = width;
  images.height = height;
  for (int i = 0; i < width * height * 3; ++i) {
    const double x = i / 3 % width, y = i / 3 / width;
    const double smooth = 0.5 + 0.4 * std::sin(0.3 * x + i % 3) * std::cos(0.2 * y);
    const double value = x > 0.7 * width ? 0.25 : smooth + 0.05 * random.normal();
    images.target.push_back(T(float(value)));
    images.rgb.push_back(T(float(value + 0.1 * random.normal())));
  }
  for (int i = 0; i < width * height && mask_share < 1; ++i) {
    images.wanted.push_back(random.uniform(0, 1) < mask_share);
  }
  return images;
}

struct Expected {
  double l1 = 0, ssim = 1;
};

/// The definition, window by window.
template <typename T>
Expected reference(const ImagePair<T>& images, const Exposure& exposure = {}) {
  double l1 = 0, ssim = 0;
  std::size_t count = 0;
  for (int y = 0; y < images.height; ++y) {
    for (int x = 0; x < images.width; ++x) {
      if (!images.is_wanted(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        double weight = 0, mean_a = 0, mean_b = 0;
        const auto each = [&](auto visit) {
          for (int v = std::max(0, y - 5); v <= std::min(images.height - 1, y + 5); ++v) {
            for (int u = std::max(0, x - 5); u <= std::min(images.width - 1, x + 5); ++u) {
              if (!images.is_wanted(u, v)) continue;
              const int i = 3 * (v * images.width + u) + c;
              const double r2 = (u - x) * (u - x) + (v - y) * (v - y);
              visit(std::exp(-r2 / (2 * 1.5 * 1.5)),
                    exposure.gain[c] * double(images.rgb[i]) + exposure.offset[c],
                    double(images.target[i]));
            }
          }
        };
        each([&](double w, double a, double b) {
          weight += w;
          mean_a += w * a;
          mean_b += w * b;
        });
        mean_a /= weight;
        mean_b /= weight;
        double var_a = 0, var_b = 0, cov = 0;
        each([&](double w, double a, double b) {
          var_a += w / weight * (a - mean_a) * (a - mean_a);
          var_b += w / weight * (b - mean_b) * (b - mean_b);
          cov += w / weight * (a - mean_a) * (b - mean_b);
        });
        ssim += (2 * mean_a * mean_b + 1e-4) * (2 * cov + 9e-4) /
                ((mean_a * mean_a + mean_b * mean_b + 1e-4) * (var_a + var_b + 9e-4));
        const int i = 3 * (y * images.width + x) + c;
        l1 += std::abs(exposure.gain[c] * double(images.rgb[i]) + exposure.offset[c] -
                       double(images.target[i]));
        ++count;
      }
    }
  }
  return count ? Expected{l1 / double(count), ssim / double(count)} : Expected{};
}

template <typename T>
PhotometricLoss<T> loss_of(const ImagePair<T>& images, double lambda = 0.2,
                           const Exposure& exposure = {}, int threads = 1) {
  return photometric_loss(images.rgb.data(), images.target.data(), images.width, images.height,
                          images.mask(), lambda, exposure, threads);
}

template <typename T>
class ImageLosses : public ::testing::Test {
 public:
  static constexpr double kTolerance = sizeof(T) == 4 ? 2e-6 : 1e-12;
  /// A variance is the difference of two squares, wrong by up to 1e-7 in float, beside C2 = 9e-4.
  static constexpr double kSsimTolerance = sizeof(T) == 4 ? 2e-4 : 1e-12;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ImageLosses, Scalars);

TYPED_TEST(ImageLosses, MatchTheDefinition) {
  const Exposure exposure = {{0.8, 1.1, 1.3}, {0.1, -0.05, 0.0}};
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{
           {1, 1}, {1, 40}, {40, 1}, {3, 5}, {11, 11}, {37, 23}, {64, 64}, {29, 150}, {300, 12}}) {
    for (double share : {1.0, 0.5, 0.02}) {
      const auto images = random_images<TypeParam>(7, width, height, share);
      for (const Exposure& e : {Exposure{}, exposure}) {
        const Expected expected = reference(images, e);
        const auto loss = loss_of(images, 0.3, e);
        EXPECT_NEAR(loss.l1, expected.l1, TestFixture::kTolerance) << width << " x " << height;
        EXPECT_NEAR(loss.ssim, expected.ssim, TestFixture::kSsimTolerance)
            << width << " x " << height;
        EXPECT_NEAR(loss.value, 0.7 * loss.l1 + 0.3 * (1 - loss.ssim), 1e-15);
      }
    }
  }
}

TYPED_TEST(ImageLosses, EqualImagesLoseNothing) {
  auto images = random_images<TypeParam>(1, 33, 21);
  images.rgb = images.target;
  const auto loss = loss_of(images);
  EXPECT_EQ(loss.l1, 0);
  EXPECT_NEAR(loss.ssim, 1, TestFixture::kTolerance);
  for (TypeParam gradient : loss.dL_drgb) EXPECT_NEAR(gradient, 0, TestFixture::kTolerance);
}

TYPED_TEST(ImageLosses, ConstantImagesHaveTheirLuminanceTermOnly) {
  auto images = random_images<TypeParam>(1, 20, 15);
  std::fill(images.rgb.begin(), images.rgb.end(), TypeParam(0.75));
  std::fill(images.target.begin(), images.target.end(), TypeParam(0.25));
  const double expected = (2 * 0.75 * 0.25 + 1e-4) / (0.75 * 0.75 + 0.25 * 0.25 + 1e-4);
  // In float the variances are nearly 0, not 0.
  EXPECT_NEAR(loss_of(images).ssim, expected, sizeof(TypeParam) == 4 ? 3e-4 : 1e-12);
}

TYPED_TEST(ImageLosses, AnEmptyMaskLosesNothing) {
  auto images = random_images<TypeParam>(1, 9, 8);
  images.wanted.assign(9 * 8, 0);
  const auto loss = loss_of(images);
  EXPECT_EQ(loss.value, 0);
  EXPECT_EQ(std::count(loss.dL_drgb.begin(), loss.dL_drgb.end(), TypeParam(0)), 9 * 8 * 3);
  const Exposure exposure =
      fit_exposure(images.rgb.data(), images.target.data(), 9, 8, images.mask());
  EXPECT_EQ(exposure.gain[0], 1);
  EXPECT_EQ(exposure.offset[0], 0);
}

TYPED_TEST(ImageLosses, AFullMaskIsNoMask) {
  auto images = random_images<TypeParam>(3, 41, 70);
  const auto without = loss_of(images);
  images.wanted.assign(41 * 70, 1);
  const auto with = loss_of(images);
  EXPECT_NEAR(with.value, without.value, TestFixture::kTolerance);
  for (std::size_t i = 0; i < with.dL_drgb.size(); ++i) {
    EXPECT_NEAR(with.dL_drgb[i], without.dL_drgb[i], TestFixture::kTolerance) << i;
  }
}

TYPED_TEST(ImageLosses, WhatIsNotWantedDoesNotCount) {
  auto images = random_images<TypeParam>(4, 50, 40, 0.3);
  const auto before = loss_of(images);
  for (int i = 0; i < 50 * 40; ++i) {
    if (images.wanted[i]) continue;
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(before.dL_drgb[3 * i + c], 0);
      images.rgb[3 * i + c] = std::numeric_limits<TypeParam>::quiet_NaN();
      images.target[3 * i + c] = TypeParam(1e30);
    }
  }
  const auto after = loss_of(images);
  EXPECT_EQ(after.value, before.value);
  EXPECT_EQ(after.dL_drgb, before.dL_drgb);
}

TYPED_TEST(ImageLosses, DoNotDependOnThreads) {
  for (double share : {1.0, 0.4}) {
    const auto images = random_images<TypeParam>(5, 61, 333, share);
    const auto one = loss_of(images, 0.2, {}, 1);
    for (int threads : {2, 3, 7}) {
      const auto many = loss_of(images, 0.2, {}, threads);
      EXPECT_EQ(many.value, one.value);
      EXPECT_EQ(many.dL_drgb, one.dL_drgb);
    }
  }
}

TYPED_TEST(ImageLosses, HugeColoursGiveNumbersOrAnError) {
  for (double scale : {1e3, 1e6}) {
    auto images = random_images<TypeParam>(6, 30, 30);
    for (TypeParam& value : images.rgb) value *= TypeParam(scale);
    const auto loss = loss_of(images);
    EXPECT_TRUE(std::isfinite(loss.value));
    for (TypeParam gradient : loss.dL_drgb) EXPECT_TRUE(std::isfinite(gradient));
  }
}

TEST(ImageLossesDouble, GradientMatchesFiniteDifferences) {
  const Exposure exposure = {{0.8, 1.1, 1.3}, {0.1, -0.05, 0.0}};
  for (double share : {1.0, 0.5}) {
    for (double lambda : {0.0, 0.2, 1.0}) {
      auto images = random_images<double>(11, 23, 80, share);
      const auto loss = loss_of(images, lambda, exposure);
      for (std::size_t i = 0; i < images.rgb.size(); i += 37) {
        constexpr double kStep = 1e-6;
        const double at = images.rgb[i];
        images.rgb[i] = at + kStep;
        const double above = loss_of(images, lambda, exposure).value;
        images.rgb[i] = at - kStep;
        const double below = loss_of(images, lambda, exposure).value;
        images.rgb[i] = at;
        EXPECT_NEAR(loss.dL_drgb[i], (above - below) / (2 * kStep), 1e-9) << i;
      }
    }
  }
}

TEST(ImageLossesFloat, GradientMatchesDouble) {
  const auto exact = loss_of(random_images<double>(12, 90, 70, 0.8), 1.0);
  const auto fast = loss_of(random_images<float>(12, 90, 70, 0.8), 1.0);
  double error = 0, norm = 0;
  for (std::size_t i = 0; i < exact.dL_drgb.size(); ++i) {
    error += std::pow(double(fast.dL_drgb[i]) - exact.dL_drgb[i], 2);
    norm += std::pow(exact.dL_drgb[i], 2);
  }
  EXPECT_LT(std::sqrt(error / norm), 1e-4);
}

TYPED_TEST(ImageLosses, ExposureIsFoundExactly) {
  const Exposure truth = {{0.5, 1.25, 2.0}, {0.25, -0.5, 0.125}};
  auto images = random_images<TypeParam>(8, 31, 17, 0.7);
  for (std::size_t i = 0; i < images.rgb.size(); ++i) {
    images.target[i] = TypeParam(truth.gain[i % 3] * images.rgb[i] + truth.offset[i % 3]);
  }
  const Exposure found =
      fit_exposure(images.rgb.data(), images.target.data(), 31, 17, images.mask());
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.gain[c], truth.gain[c], TestFixture::kTolerance);
    EXPECT_NEAR(found.offset[c], truth.offset[c], TestFixture::kTolerance);
  }
  EXPECT_NEAR(loss_of(images, 0.2, found).value, 0, TestFixture::kTolerance);
}

TYPED_TEST(ImageLosses, AConstantRenderingIsOnlyShifted) {
  auto images = random_images<TypeParam>(8, 12, 12);
  std::fill(images.rgb.begin(), images.rgb.end(), TypeParam(0.3));
  const Exposure found = fit_exposure(images.rgb.data(), images.target.data(), 12, 12);
  EXPECT_EQ(found.gain[1], 1);
  double mean = 0;
  for (std::size_t i = 1; i < images.target.size(); i += 3) mean += images.target[i] / 144;
  EXPECT_NEAR(found.offset[1], mean - 0.3, 1e-6);
}

TYPED_TEST(ImageLosses, DepthCountsWhatWasMeasuredAndRendered) {
  const TypeParam nan = std::numeric_limits<TypeParam>::quiet_NaN();
  const TypeParam depth[] = {2, 0, 1, 1, 3, 4}, target[] = {TypeParam(1.5), 2, 0, nan, 4, 7};
  const std::uint8_t wanted[] = {1, 1, 1, 1, 1, 0};
  const auto loss = depth_loss(depth, target, 3, 2, {wanted, 3, 2});
  EXPECT_EQ(loss.count, 2u);
  EXPECT_DOUBLE_EQ(loss.value, (0.5 + 1.0) / 2);
  EXPECT_THAT(loss.dL_ddepth, ::testing::ElementsAre(TypeParam(0.5), 0, 0, 0, TypeParam(-0.5), 0));
}

TYPED_TEST(ImageLosses, ATinyDepthIsNoMeasurement) {
  const TypeParam depth[] = {1, 1, 1};
  const TypeParam target[] = {std::numeric_limits<TypeParam>::denorm_min(), TypeParam(1e-38), 2};
  for (bool relative : {false, true}) {
    const auto loss = depth_loss(depth, target, 3, 1, {}, relative);
    EXPECT_EQ(loss.count, 1u);
    EXPECT_DOUBLE_EQ(loss.value, relative ? 0.5 : 1.0);
    EXPECT_THAT(loss.dL_ddepth, ::testing::ElementsAre(0, 0, TypeParam(-loss.value)));
  }
}

TYPED_TEST(ImageLosses, NameWhatIsWrong) {
  const auto expect_error = [](auto call, const std::string& text) {
    try {
      call();
      FAIL() << "no error: " << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(text));
    }
  };
  auto images = random_images<TypeParam>(9, 7, 6);
  expect_error([&] { loss_of(images, 1.5); }, "photometric_loss: dssim_weight must be in [0, 1]");
  expect_error([&] { loss_of(images, std::nan("")); }, "dssim_weight");
  images.wanted.assign(42, 1);
  expect_error(
      [&] { photometric_loss(images.rgb.data(), images.target.data(), 6, 7, images.mask()); },
      "photometric_loss: mask is 7 x 6 pixels, but the image is 6 x 7");
  images.target[3 * (2 * 7 + 4) + 1] = std::numeric_limits<TypeParam>::infinity();
  expect_error([&] { loss_of(images); }, "photometric_loss: target[2,4,1] is inf, must be finite");
  expect_error([&] { fit_exposure(images.rgb.data(), images.target.data(), 7, 6); },
               "fit_exposure: target[2,4,1] is inf, must be finite");
  const TypeParam depth[] = {1, -1};
  expect_error([&] { depth_loss(depth, depth, 2, 1); }, "depth_loss: depth[0,1] is -1");
  expect_error([&] { depth_loss(depth, depth, 0, 1); }, "must be positive, got 0 x 1");
}

}  // namespace
}  // namespace gslts::optim
