// Wrong arguments are rejected with a message that names the function, the argument and the value.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_losses.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;
using ::testing::HasSubstr;

template <typename Error, typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

template <typename T>
class RasterErrors : public ::testing::Test {
 protected:
  RasterErrors() {
    SceneShape shape;
    shape.gaussians = 5000;  // More than a chunk.
    shape.sh_bases = 4;
    shape.feature_dims = 2;
    map_ = converted<T>(random_scene(1, camera_, shape));
    loss_ = random_loss<T>(1, camera_, 2);
  }
  std::string forward_error() {
    return error_of<std::invalid_argument>(
        [&] { Rasterizer<T>().forward(map_.view(), camera_, options_); });
  }
  std::string backward_error() {
    Rasterizer<T> rasterizer;
    rasterizer.forward(map_.view(), camera_, options_);
    return error_of<std::invalid_argument>(
        [&] { rasterizer.backward(map_.view(), loss_.gradients()); });
  }

  Camera camera_ = tilted_camera(70, 40);
  RenderOptions options_;
  BasicGaussianMap<T> map_;
  LinearLoss<T> loss_;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterErrors, Scalars);

TYPED_TEST(RasterErrors, NumbersThatAreNotFiniteAreNamed) {
  struct Bad {
    Array<TypeParam>* array;
    std::size_t at;
    const char* name;
  };
  using Limits = std::numeric_limits<TypeParam>;
  auto& map = this->map_;
  for (const Bad& bad :
       {Bad{&map.means, 3 * 4990 + 2, "means[4990,2]"}, Bad{&map.quats, 4 * 12 + 3, "quats[12,3]"},
        Bad{&map.log_scales, 3 * 12 + 1, "log_scales[12,1]"},
        Bad{&map.logit_opacities, 4999, "logit_opacities[4999]"},
        Bad{&map.sh, 12 * 70 + 3 * 3 + 1, "sh[70,3,1]"},
        Bad{&map.features, 2 * 4200 + 1, "features[4200,1]"}}) {
    const TypeParam good = (*bad.array)[bad.at];
    for (TypeParam value : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
      (*bad.array)[bad.at] = value;
      EXPECT_THAT(this->forward_error(),
                  HasSubstr("Rasterizer::forward: " + std::string(bad.name)));
    }
    (*bad.array)[bad.at] = good;
  }
  EXPECT_EQ(this->forward_error(), "nothing was thrown");
}

/// Also outside of the view of the camera.
TYPED_TEST(RasterErrors, AGaussianBehindTheCameraMustBeFiniteToo) {
  Gaussian g;
  g.mean.z() = -3;
  this->map_ = map_of<TypeParam>({g, g});
  this->camera_ = straight_camera(20, 20, 20);
  this->map_.sh[4] = std::numeric_limits<TypeParam>::quiet_NaN();
  EXPECT_EQ(this->forward_error(), "Rasterizer::forward: sh[1,0,1] is nan");
}

TYPED_TEST(RasterErrors, OptionsOutOfRangeAreNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const auto error_after = [&](auto change) {
    this->options_ = {};
    change(this->options_);
    return this->forward_error();
  };
  EXPECT_EQ(error_after([](auto& o) { o.sh_degree = 4; }),
            "Rasterizer::forward: options.sh_degree must be 0, 1, 2 or 3, got 4");
  EXPECT_THAT(error_after([](auto& o) { o.sh_degree = -1; }), HasSubstr("options.sh_degree"));
  for (double bad : {0.0, -1.0, nan, inf}) {
    EXPECT_THAT(error_after([&](auto& o) { o.near_m = bad; }), HasSubstr("options.near_m"));
    if (!(bad > 0)) {
      EXPECT_THAT(error_after([&](auto& o) { o.far_m = bad; }), HasSubstr("options.far_m"));
    }
  }
  for (double bad : {-0.1, nan, inf}) {
    EXPECT_THAT(error_after([&](auto& o) { o.eps2d_px2 = bad; }), HasSubstr("options.eps2d_px2"));
  }
  for (double bad : {0.0, 1e-31, -1.0, 0.99, 1.0, nan, inf}) {
    EXPECT_THAT(error_after([&](auto& o) { o.alpha_min = bad; }), HasSubstr("options.alpha_min"));
  }
  for (double bad : {-1e-9, 1.0, 2.0, nan, inf}) {
    EXPECT_THAT(error_after([&](auto& o) { o.transmittance_min = bad; }),
                HasSubstr("options.transmittance_min"));
  }
  for (int bad : {-1, 0, 2, 4, 6}) {
    EXPECT_THAT(error_after([&](auto& o) { o.exp_degree = bad; }), HasSubstr("options.exp_degree"));
  }
  for (double bad : {nan, inf, -inf}) {
    EXPECT_THAT(error_after([&](auto& o) { o.background[1] = bad; }),
                HasSubstr("options.background"));
  }
  EXPECT_THAT(error_after([](auto& o) { o.threads = -1; }), HasSubstr("threads"));
  EXPECT_EQ(error_after([](auto& o) { o.alpha_min = 1e-30, o.transmittance_min = 0; }),
            "nothing was thrown");
}

TEST(RasterErrorsFloat, OptionsBeyondFloatAreNamed) {
  const Camera camera = tilted_camera(20, 10);
  const auto map = random_scene(1, camera, {});
  const auto expect_error = [&](auto change, const std::string& text) {
    RenderOptions options;
    change(options);
    const auto forward = [&](const auto& same) {
      using T = std::decay_t<decltype(same.means[0])>;
      return error_of<std::invalid_argument>(
          [&] { Rasterizer<T>().forward(same.view(), camera, options); });
    };
    EXPECT_THAT(forward(converted<float>(map)), HasSubstr("options." + text));
    EXPECT_EQ(forward(map), "nothing was thrown");
  };
  expect_error([](auto& o) { o.background[2] = 1e300; },
               "background must be finite in float32, got 1e+300");
  expect_error([](auto& o) { o.eps2d_px2 = 1e39; }, "eps2d_px2 must be finite in float32");
  expect_error([](auto& o) { o.near_m = 1e39, o.far_m = 1e40; }, "near_m must be finite");
  expect_error([](auto& o) { o.near_sigmas = 1e20; }, "near_sigmas must be finite");
}

TYPED_TEST(RasterErrors, BadCamerasAreNamed) {
  this->camera_.fx = -3;
  EXPECT_EQ(this->forward_error(),
            "Rasterizer::forward: camera.fx must be positive and finite, got -3");
  this->camera_ = tilted_camera(70, 40);
  this->camera_.height = 0;
  EXPECT_THAT(this->forward_error(), HasSubstr("Rasterizer::forward: camera.height"));
}

TYPED_TEST(RasterErrors, AMaskOfAnotherSizeIsRefused) {
  const std::vector<std::uint8_t> mask(70 * 40, 1);
  for (const PixelMask& bad : {PixelMask{mask.data(), 40, 70}, PixelMask{mask.data(), 70, 39},
                               PixelMask{mask.data(), 0, 0}}) {
    EXPECT_THAT(error_of<std::invalid_argument>([&] {
                  Rasterizer<TypeParam>().forward(this->map_.view(), this->camera_, {}, bad);
                }),
                HasSubstr("Rasterizer::forward: mask"));
  }
}

TYPED_TEST(RasterErrors, NullArraysAreRefused) {
  GaussianView<TypeParam> view = this->map_.view();
  view.quats = nullptr;
  EXPECT_THAT(error_of<std::invalid_argument>(
                  [&] { Rasterizer<TypeParam>().forward(view, this->camera_); }),
              HasSubstr("Rasterizer::forward: quats"));
}

TYPED_TEST(RasterErrors, BackwardNeedsAForward) {
  Rasterizer<TypeParam> rasterizer;
  const auto backward = [&] { rasterizer.backward(this->map_.view(), this->loss_.gradients()); };
  EXPECT_THAT(error_of<std::logic_error>(backward), HasSubstr("Rasterizer::backward"));
  // One that failed does not count, nor does the one before it.
  rasterizer.forward(this->map_.view(), this->camera_);
  EXPECT_NO_THROW(backward());
  Camera bad = this->camera_;
  bad.fx = 0;
  EXPECT_THROW(rasterizer.forward(this->map_.view(), bad), std::invalid_argument);
  EXPECT_THAT(error_of<std::logic_error>(backward), HasSubstr("Rasterizer::backward"));
  // And a failure is no end.
  rasterizer.forward(this->map_.view(), this->camera_);
  EXPECT_NO_THROW(backward());
}

TYPED_TEST(RasterErrors, BackwardRefusesOtherShapes) {
  Rasterizer<TypeParam> rasterizer;
  rasterizer.forward(this->map_.view(), this->camera_);
  const auto error_after = [&](auto change) {
    GaussianView<TypeParam> view = this->map_.view();
    change(view);
    return error_of<std::invalid_argument>(
        [&] { rasterizer.backward(view, this->loss_.gradients()); });
  };
  EXPECT_THAT(error_after([](auto& view) { --view.size; }), HasSubstr("Rasterizer::backward"));
  EXPECT_THAT(error_after([](auto& view) { view.sh_bases = 1; }),
              HasSubstr("Rasterizer::backward"));
  EXPECT_THAT(error_after([](auto& view) { view.feature_dims = 1; }),
              HasSubstr("Rasterizer::backward"));
  EXPECT_EQ(error_after([](auto&) {}), "nothing was thrown");
}

TYPED_TEST(RasterErrors, ImageGradientsThatAreNotFiniteAreNamed) {
  using Limits = std::numeric_limits<TypeParam>;
  auto& loss = this->loss_;
  struct Bad {
    Array<TypeParam>* array;
    std::size_t at;
    const char* name;
  };
  const std::size_t pixel = 33 * 70 + 41;
  for (const Bad& bad :
       {Bad{&loss.rgb, 3 * pixel + 1, "dL_drgb[33,41,1]"},
        Bad{&loss.depth, pixel, "dL_ddepth[33,41]"}, Bad{&loss.alpha, pixel, "dL_dalpha[33,41]"},
        Bad{&loss.features, 2 * pixel, "dL_dfeatures[33,41,0]"}}) {
    const TypeParam good = (*bad.array)[bad.at];
    for (TypeParam value : {Limits::quiet_NaN(), Limits::infinity()}) {
      (*bad.array)[bad.at] = value;
      EXPECT_THAT(this->backward_error(),
                  HasSubstr("Rasterizer::backward: " + std::string(bad.name)));
    }
    (*bad.array)[bad.at] = good;
  }
  EXPECT_EQ(this->backward_error(), "nothing was thrown");
}

/// A mistake must not depend on what the camera happens to see.
TYPED_TEST(RasterErrors, ImageGradientsMustBeFiniteWhereNothingIsSeenToo) {
  this->map_ = make_gaussian_map<TypeParam>(0, 1, 2);
  this->loss_.depth[0] = std::numeric_limits<TypeParam>::quiet_NaN();
  EXPECT_THAT(this->backward_error(), HasSubstr("Rasterizer::backward: dL_ddepth[0,0]"));
}

/// Finite image gradients so large that their sums overflow are no NaN of the caller's.
TYPED_TEST(RasterErrors, HugeImageGradientsAreNotMistakenForNan) {
  for (TypeParam& value : this->loss_.rgb) value = std::numeric_limits<TypeParam>::max();
  EXPECT_EQ(this->backward_error(), "nothing was thrown");
}

}  // namespace
}  // namespace gslts::raster
