// Frames, units and signs, on scenes whose image is known without any renderer.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "gslts/raster/rasterizer.hpp"
#include "raster_scenes.hpp"

namespace gslts::raster {
namespace {

using namespace testing;

template <typename T>
class RasterConventions : public ::testing::Test {
 protected:
  static Images<T> render(const std::vector<Gaussian>& gaussians, const Camera& camera,
                          const RenderOptions& options = precise_options()) {
    return Rasterizer<T>().forward(map_of<T>(gaussians).view(), camera, options);
  }
  static T alpha_at(const Images<T>& images, int x, int y) {
    return images.alpha[std::size_t(y) * std::size_t(images.width) + std::size_t(x)];
  }
  /// Second moments (xx, xy, yy) of alpha about its centre, px^2.
  static Eigen::Vector3d moments(const Images<T>& images) {
    double sum = 0, x_sum = 0, y_sum = 0, xx = 0, xy = 0, yy = 0;
    for (int y = 0; y < images.height; ++y) {
      for (int x = 0; x < images.width; ++x) {
        const double a = double(alpha_at(images, x, y));
        sum += a;
        x_sum += a * x;
        y_sum += a * y;
        xx += a * x * x;
        xy += a * x * y;
        yy += a * y * y;
      }
    }
    const double mx = x_sum / sum, my = y_sum / sum;
    return {xx / sum - mx * mx, xy / sum - mx * my, yy / sum - my * my};
  }
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RasterConventions, Scalars);

/// A Gaussian of standard deviation s px and opacity 1/2 at z = 2 m, focal length 100 px.
Gaussian round_gaussian(double x_m, double y_m) {
  Gaussian g;
  g.mean = {x_m, y_m, 2};
  g.scale_m.setConstant(0.04);
  return g;
}

TYPED_TEST(RasterConventions, PixelCentresAreAtHalves) {
  // x = 0.31 m at 2 m and 100 px: column 20 + 15.5, the centre of pixel 35; y: the centre of 13.
  Camera camera = straight_camera(40, 30, 100);
  const auto images = this->render({round_gaussian(0.31, -0.03)}, camera);
  for (int d = 1; d < 4; ++d) {
    EXPECT_NEAR(this->alpha_at(images, 35 - d, 13), this->alpha_at(images, 35 + d, 13), 1e-6);
    EXPECT_NEAR(this->alpha_at(images, 35, 13 - d), this->alpha_at(images, 35, 13 + d), 1e-6);
  }
  EXPECT_NEAR(this->alpha_at(images, 35, 13), 0.5, 1e-6);
  // Its variance is (100 / 2 * 0.04)^2 px^2, and 0.3 px^2 from the low-pass filter. The Jacobian
  // slants by x/z off the axis, which adds that share squared.
  const double tan_y = -0.015, variance = 4 * (1 + tan_y * tan_y) + 0.3;
  EXPECT_NEAR(this->alpha_at(images, 35, 15), 0.5 * std::exp(-0.5 * 4 / variance), 1e-4);
}

TYPED_TEST(RasterConventions, XIsRightYIsDownZIsForward) {
  const Camera camera = straight_camera(40, 30, 100);
  const auto images = this->render({round_gaussian(0.21, 0.11)}, camera);
  EXPECT_NEAR(this->alpha_at(images, 30, 20), 0.5, 1e-6);
  Gaussian behind = round_gaussian(0, 0);
  behind.mean.z() = -2;
  const auto empty = this->render({behind}, camera);
  for (TypeParam alpha : empty.alpha) ASSERT_EQ(alpha, 0);
}

TYPED_TEST(RasterConventions, PoseIsWorldFromCamera) {
  // A camera at (3, -1, 1) that looks along world x, world z up: world -y is right, -z is down.
  Camera camera = straight_camera(40, 30, 100);
  camera.world_from_camera = look_at({3, -1, 1}, {4, -1, 1});
  Gaussian g = round_gaussian(0, 0);
  g.mean = {3 + 2, -1 - 0.21, 1 - 0.11};
  const auto images = this->render({g}, camera);
  EXPECT_NEAR(this->alpha_at(images, 30, 20), 0.5, 1e-5);
}

TYPED_TEST(RasterConventions, DepthIsZOfTheCentreAndZeroWhereNothingIs) {
  const Camera camera = straight_camera(60, 30, 20);
  Gaussian g = round_gaussian(2, 0);  // Distance sqrt(8) m, but z = 2 m.
  RenderOptions of_centres = precise_options();
  of_centres.surface_depth = false;
  const auto images = this->render({g}, camera, of_centres);
  const std::size_t at = 15 * 60 + 50;
  ASSERT_GT(images.alpha[at], 0.1);
  EXPECT_NEAR(images.depth[at], 2, 1e-6);
  EXPECT_EQ(images.alpha[0], 0);
  EXPECT_EQ(images.depth[0], 0);
}

TYPED_TEST(RasterConventions, ASlantedSurfaceHasItsOwnDepthAtEachPixel) {
  // A disc in the plane z = 2 + x, of 0.1 m: its normal halves the angle between -x and z.
  const Camera camera = straight_camera(81, 81, 200);
  Gaussian g;
  g.mean = {0, 0, 2};
  g.scale_m = {0.1, 0.1, 1e-4};
  const double half =
      -std::acos(-1) / 8;  // Half of a turn by -45 degrees about y: x goes to x + z.
  g.quat_wxyz = {std::cos(half), 0, std::sin(half), 0};
  const auto images = this->render({g}, camera);
  for (int x = 34; x <= 46; ++x) {
    const double tan_x = (x + 0.5 - camera.cx) / camera.fx;
    const std::size_t at = std::size_t(40) * 81 + std::size_t(x);
    ASSERT_GT(images.alpha[at], 0.1);
    // Where the ray meets the plane; the affine approximation errs by the square of the angle.
    EXPECT_NEAR(images.depth[at], 2 / (1 - tan_x), 3e-3) << x;
  }
  // From one end to the other it is a step that the depth of the centre would not show.
  EXPECT_GT(images.depth[40 * 81 + 46] - images.depth[40 * 81 + 34], 0.11);
}

TYPED_TEST(RasterConventions, AGaussianAroundTheCameraHasTheDepthOfItsCentre) {
  const Camera camera = straight_camera(41, 41, 50);
  Gaussian g;
  g.mean = {0, 0, 0.5};
  g.scale_m = {0.001, 0.5, 1.5};
  const double half = -std::acos(-1) / 8;
  g.quat_wxyz = {std::cos(half), 0, std::sin(half), 0};
  const auto images = this->render({g}, camera);
  for (std::size_t k = 0; k < images.depth.size(); ++k) {
    if (images.alpha[k] > 0) {
      ASSERT_NEAR(images.depth[k], 0.5, 1e-6);
    }
  }
}

TYPED_TEST(RasterConventions, DepthIsTheMeanOverTheWeights) {
  const Camera camera = straight_camera(11, 11, 100);
  Gaussian front = round_gaussian(0, 0), back = front;
  front.opacity = 0.4;
  back.mean.z() = 5;
  back.opacity = 0.7;
  back.scale_m *= 2.5;
  const auto images = this->render({back, front}, camera);
  const double w_front = 0.4, w_back = 0.6 * 0.7;
  EXPECT_NEAR(images.alpha[5 * 11 + 5], w_front + w_back, 1e-6);
  EXPECT_NEAR(images.depth[5 * 11 + 5], (w_front * 2 + w_back * 5) / (w_front + w_back), 1e-5);
}

TYPED_TEST(RasterConventions, NearerGaussiansHideFartherOnes) {
  const Camera camera = straight_camera(11, 11, 100);
  Gaussian front = round_gaussian(0, 0), back = front;
  front.opacity = 0.75;
  front.color = {1, 0, 0};
  back.mean.z() = 3;
  back.color = {0, 1, 0};
  RenderOptions options = precise_options();
  options.background = {0, 0, 1};
  const auto images = this->render({back, front}, camera, options);
  const std::size_t at = 5 * 11 + 5;
  EXPECT_NEAR(images.rgb[3 * at], 0.75, 1e-6);
  EXPECT_NEAR(images.rgb[3 * at + 1], 0.25 * 0.5, 1e-6);
  EXPECT_NEAR(images.rgb[3 * at + 2], 0.25 * 0.5, 1e-6);
}

TYPED_TEST(RasterConventions, QuaternionsAreWxyzAndTurnFromTheGaussianToTheMap) {
  const Camera camera = straight_camera(81, 81, 100);
  Gaussian g;
  g.mean = {0, 0, 2};
  g.scale_m = {0.2, 0.02, 0.02};  // Long along its own x.
  const auto lying = this->moments(this->render({g}, camera));
  EXPECT_GT(lying[0], 20 * lying[2]);
  EXPECT_NEAR(lying[1], 0, 1e-3);
  // +30 degrees about z turns x towards y, which points down in the image: xy is positive.
  const double half = 15 * kPi / 180;
  g.quat_wxyz = {std::cos(half), 0, 0, std::sin(half)};
  const auto turned = this->moments(this->render({g}, camera));
  EXPECT_GT(turned[1], 0);
  EXPECT_NEAR(0.5 * std::atan2(2 * turned[1], turned[0] - turned[2]), 30 * kPi / 180, 2e-3);
  // 90 degrees about z: upright. About y: the long axis points along the view.
  g.quat_wxyz = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  const auto upright = this->moments(this->render({g}, camera));
  EXPECT_GT(upright[2], 20 * upright[0]);
  g.quat_wxyz = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  const auto along_view = this->moments(this->render({g}, camera));
  EXPECT_NEAR(along_view[0], along_view[2], 1e-3);
  EXPECT_LT(along_view[0], lying[0] / 20);
  // Half a turn about x leaves it lying.
  g.quat_wxyz = {0, 1, 0, 0};
  const auto flipped = this->moments(this->render({g}, camera));
  EXPECT_NEAR((flipped - lying).norm(), 0, 1e-3);
}

TYPED_TEST(RasterConventions, OnlyTheDirectionOfAQuaternionCounts) {
  const Camera camera = straight_camera(41, 41, 100);
  Gaussian g;
  g.scale_m = {0.2, 0.02, 0.05};
  g.quat_wxyz = {0.7, -0.2, 0.4, 0.5};
  const auto unit = this->render({g}, camera);
  for (double factor : {1e-6, 1e-3, 50.0, 1e9, -1.0}) {
    Gaussian scaled = g;
    scaled.quat_wxyz *= factor;
    const auto images = this->render({scaled}, camera);
    for (std::size_t i = 0; i < unit.alpha.size(); ++i) {
      ASSERT_NEAR(images.alpha[i], unit.alpha[i], 2e-6) << factor;
    }
  }
}

TYPED_TEST(RasterConventions, AShortQuaternionIsNoRotation) {
  const Camera camera = straight_camera(41, 41, 100);
  Gaussian g;
  g.scale_m = {0.2, 0.02, 0.05};
  const auto identity = this->render({g}, camera);
  for (const Eigen::Vector4d& quat :
       {Eigen::Vector4d(0, 0, 0, 0), Eigen::Vector4d(0, 9e-13, 0, 0),
        Eigen::Vector4d(0, 0, 0, 1e-30), Eigen::Vector4d(4e-13, 4e-13, 4e-13, 4e-13)}) {
    g.quat_wxyz = quat;
    EXPECT_EQ(this->render({g}, camera).alpha, identity.alpha) << quat.transpose();
  }
  // Just long enough: a quarter turn about z, though no single component reaches 1e-12.
  g.quat_wxyz = {8e-13, 0, 0, 8e-13};
  const auto turned = this->moments(this->render({g}, camera));
  EXPECT_GT(turned[2], 20 * turned[0]);
}

TYPED_TEST(RasterConventions, NearPlaneCullsByCentreDepth) {
  const Camera camera = straight_camera(11, 11, 10);
  Gaussian g = round_gaussian(0, 0);
  g.scale_m.setConstant(0.3);
  RenderOptions options = precise_options();
  options.near_m = 0.5;
  options.near_sigmas = 0;
  for (const auto& [z, seen] :
       {std::pair(0.25, false), {0.5, false}, {0.515625, true}, {4., true}}) {
    g.mean.z() = z;
    EXPECT_EQ(this->alpha_at(this->render({g}, camera, options), 5, 5) > 0, seen) << z;
  }
}

TYPED_TEST(RasterConventions, NearSigmasCullWhatReachesTheCameraAlongTheView) {
  const Camera camera = straight_camera(11, 11, 10);
  Gaussian g = round_gaussian(0, 0);
  RenderOptions options = precise_options();
  options.near_sigmas = 3;
  g.mean.z() = 1;
  for (const auto& [x, y, z, seen] :
       {std::tuple(0.5, 0.5, 0.25, true), {0.1, 0.1, 0.34375, false}, {0.1, 0.1, 0.328125, true}}) {
    g.scale_m = {x, y, z};
    EXPECT_EQ(this->alpha_at(this->render({g}, camera, options), 5, 5) > 0, seen) << z;
  }
}

TYPED_TEST(RasterConventions, ColourIsHalfPlusShAndNeverNegative) {
  const Camera camera = straight_camera(11, 11, 100);
  Gaussian g = round_gaussian(0, 0);
  g.color = {0.9, -0.7, 0.1};
  const auto images = this->render({g}, camera);
  const std::size_t at = 5 * 11 + 5;
  EXPECT_NEAR(images.rgb[3 * at], 0.45, 1e-6);
  EXPECT_EQ(images.rgb[3 * at + 1], 0);
  EXPECT_NEAR(images.rgb[3 * at + 2], 0.05, 1e-6);
}

/// The first band of 3DGS is (-y, z, -x): each coefficient brightens one world direction.
TYPED_TEST(RasterConventions, ShDirectionsAreWorldAxesFromCameraToGaussian) {
  const double c1 = 0.4886025119029199;
  const Eigen::Vector3d eye(1, 2, 3);
  for (int axis = 0; axis < 3; ++axis) {
    for (double sign : {-1.0, 1.0}) {
      const Eigen::Vector3d direction = sign * Eigen::Vector3d::Unit(axis);
      Gaussian g;
      g.mean = eye + 2 * direction;
      g.color.setConstant(0.5);
      auto map = map_of<TypeParam>({g}, 4);
      map.sh[3] = TypeParam(0.3);          // Red: -y
      map.sh[2 * 3 + 1] = TypeParam(0.3);  // Green: z
      map.sh[3 * 3 + 2] = TypeParam(0.3);  // Blue: -x
      Camera camera = straight_camera(11, 11, 100);
      camera.world_from_camera = look_at(eye, g.mean, Eigen::Vector3d(0.3, 0.5, 0.7));
      const auto images = Rasterizer<TypeParam>().forward(map.view(), camera, precise_options());
      const TypeParam* rgb = &images.rgb[3 * (5 * 11 + 5)];
      EXPECT_NEAR(rgb[0], 0.5 * (0.5 - 0.3 * c1 * direction.y()), 1e-5);
      EXPECT_NEAR(rgb[1], 0.5 * (0.5 + 0.3 * c1 * direction.z()), 1e-5);
      EXPECT_NEAR(rgb[2], 0.5 * (0.5 - 0.3 * c1 * direction.x()), 1e-5);
    }
  }
}

TYPED_TEST(RasterConventions, AntialiasKeepsTheEnergyOfSmallGaussians) {
  const Camera camera = straight_camera(21, 21, 100);
  RenderOptions options = precise_options();
  options.antialias = true;
  options.alpha_min = 1e-9;
  const auto energy = [&](double scale_m) {
    Gaussian g = round_gaussian(0, 0);
    g.scale_m.setConstant(scale_m);
    double sum = 0;
    for (TypeParam alpha : this->render({g}, camera, options).alpha) sum += double(alpha);
    return sum;
  };
  // The area of the footprint shrinks with the square of the scale, and so must what is blended.
  EXPECT_NEAR(energy(0.001) / energy(0.002), 0.25, 0.01);
  // 1 %, as the pixels only sample the footprint.
  EXPECT_NEAR(energy(0.002) / (0.5 * 2 * kPi * 0.1 * 0.1), 1, 0.01);
}

}  // namespace
}  // namespace gslts::raster
