#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "gslts/map/camera.hpp"

namespace gslts {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kPi = 3.14159265358979323846;

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

Camera good_camera() { return {500, 510, 320, 240, 640, 480, Eigen::Isometry3d::Identity()}; }

/// Applies `change` to a valid camera; returns the error message of `validate`.
template <typename Change>
std::string error_after(Change change) {
  Camera camera = good_camera();
  change(camera);
  return error_of([&] { validate(camera, "Caller::method"); });
}

TEST(CameraValidate, AcceptsGoodCameras) {
  EXPECT_NO_THROW(validate(good_camera(), "test"));
  Camera camera = good_camera();
  camera.cx = -1000;  // The principal point may lie outside the image.
  camera.width = 65536;
  camera.height = 1;
  camera.world_from_camera = look_at({1e6, -1e6, 3}, {1e6 + 1, -1e6, 2});
  EXPECT_NO_THROW(validate(camera, "test"));
}

TEST(CameraValidate, AcceptsARotationThatWentThroughFloat) {
  Camera camera = good_camera();
  const Eigen::Matrix3f rounded =
      Eigen::Quaterniond(0.1, -0.7, 0.3, 0.4).normalized().toRotationMatrix().cast<float>();
  camera.world_from_camera.linear() = rounded.cast<double>();
  EXPECT_NO_THROW(validate(camera, "test"));
}

TEST(CameraValidate, NamesCallerFieldAndValue) {
  EXPECT_EQ(error_after([](Camera& c) { c.fx = -3; }),
            "Caller::method: camera.fx must be positive and finite, got -3");
}

TEST(CameraValidate, RejectsEveryBadField) {
  for (double bad : {0.0, -1.0, kNan, kInf, -kInf}) {
    EXPECT_THAT(error_after([&](Camera& c) { c.fx = bad; }), HasSubstr("camera.fx"));
    EXPECT_THAT(error_after([&](Camera& c) { c.fy = bad; }), HasSubstr("camera.fy"));
  }
  for (double bad : {kNan, kInf, -kInf}) {
    EXPECT_THAT(error_after([&](Camera& c) { c.cx = bad; }), HasSubstr("camera.cx"));
    EXPECT_THAT(error_after([&](Camera& c) { c.cy = bad; }), HasSubstr("camera.cy"));
    EXPECT_THAT(error_after([&](Camera& c) { c.world_from_camera.translation()(1) = bad; }),
                HasSubstr("translation"));
    EXPECT_THAT(error_after([&](Camera& c) { c.world_from_camera.linear()(2, 0) = bad; }),
                HasSubstr("rotation"));
  }
  for (int bad : {0, -1, 65537, std::numeric_limits<int>::min()}) {
    const std::string value = "got " + std::to_string(bad);
    EXPECT_THAT(error_after([&](Camera& c) { c.width = bad; }),
                testing::AllOf(HasSubstr("camera.width"), HasSubstr(value)));
    EXPECT_THAT(error_after([&](Camera& c) { c.height = bad; }),
                testing::AllOf(HasSubstr("camera.height"), HasSubstr(value)));
  }
}

TEST(CameraValidate, RejectsMatricesThatAreNoRotations) {
  const auto rotation = HasSubstr("rotation matrix");
  EXPECT_THAT(error_after([](Camera& c) { c.world_from_camera.linear() *= 1.00001; }), rotation);
  EXPECT_THAT(error_after([](Camera& c) { c.world_from_camera.linear().setZero(); }), rotation);
  EXPECT_THAT(error_after([](Camera& c) { c.world_from_camera.linear()(0, 1) = 2e-6; }), rotation);
  // A mirror is orthonormal, but turns a right hand into a left one.
  EXPECT_THAT(error_after([](Camera& c) { c.world_from_camera.linear()(2, 2) = -1; }), rotation);
}

TEST(CameraFromFov, SeesTheFieldOfViewAcrossTheImage) {
  const double fov = 70.0 * kPi / 180.0;
  const Camera camera = camera_from_fov(640, 480, fov);
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.cx, 320);
  EXPECT_EQ(camera.cy, 240);
  EXPECT_EQ(camera.fx, camera.fy);
  // A ray at half the field of view meets the right border of the last pixel.
  EXPECT_NEAR(camera.fx * std::tan(fov / 2) + camera.cx, 640, 1e-9);
  EXPECT_TRUE(camera.world_from_camera.isApprox(Eigen::Isometry3d::Identity(), 0));
}

TEST(CameraFromFov, KeepsThePose) {
  const Eigen::Isometry3d pose = look_at({1, 2, 3}, {4, 4, 2});
  EXPECT_EQ(camera_from_fov(10, 10, 1.0, pose).world_from_camera.matrix(), pose.matrix());
}

TEST(CameraFromFov, RejectsBadArguments) {
  for (double bad : {0.0, -0.5, kPi, 4.0, kNan, kInf}) {
    EXPECT_THAT(error_of([&] { camera_from_fov(640, 480, bad); }),
                HasSubstr("camera_from_fov: horizontal_fov_rad"));
  }
  EXPECT_EQ(error_of([] { camera_from_fov(0, 480, 1.0); }),
            "camera_from_fov: width must be in 1..65536, got 0");
  EXPECT_EQ(error_of([] { camera_from_fov(640, 65537, 1.0); }),
            "camera_from_fov: height must be in 1..65536, got 65537");
  Eigen::Isometry3d scaled = Eigen::Isometry3d::Identity();
  scaled.linear() *= 2;
  EXPECT_THAT(error_of([&] { camera_from_fov(640, 480, 1.0, scaled); }), HasSubstr("rotation"));
}

TEST(LookAt, PutsTheTargetOnTheOpticalAxis) {
  const Vector3d eye(1, 2, 1.5), target(4, -2, 0.5);
  const Eigen::Isometry3d pose = look_at(eye, target);
  const Vector3d target_in_camera = pose.inverse() * target;
  EXPECT_NEAR(target_in_camera.x(), 0, 1e-12);
  EXPECT_NEAR(target_in_camera.y(), 0, 1e-12);
  EXPECT_NEAR(target_in_camera.z(), (target - eye).norm(), 1e-12);
  EXPECT_EQ(pose.translation(), eye);
  EXPECT_NEAR((pose.linear().transpose() * pose.linear() - Eigen::Matrix3d::Identity()).norm(), 0,
              1e-14);
  EXPECT_NEAR(pose.linear().determinant(), 1, 1e-14);
}

TEST(LookAt, HoldsTheImageUpright) {
  // Looking along world x with z up: right is -y, down is -z.
  const Eigen::Isometry3d pose = look_at({0, 0, 0}, {2, 0, 0});
  EXPECT_NEAR((pose.linear().col(0) - Vector3d(0, -1, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((pose.linear().col(1) - Vector3d(0, 0, -1)).norm(), 0, 1e-15);
  EXPECT_NEAR((pose.linear().col(2) - Vector3d(1, 0, 0)).norm(), 0, 1e-15);
  // Tilted down, a point above the target is still seen above it, and the horizon is level.
  const Eigen::Isometry3d tilted = look_at({0, 0, 3}, {2, 1, 0});
  EXPECT_LT((tilted.inverse() * Vector3d(2, 1, 0.5)).y(), 0);
  EXPECT_NEAR(tilted.linear()(2, 0), 0, 1e-15);
}

TEST(Cropped, SeesTheSameRays) {
  const Camera camera = camera_from_fov(64, 48, 1.1, look_at({1, 2, 3}, {0, 0, 1}));
  const Camera part = cropped(camera, 10, 5, 31, 48);
  EXPECT_EQ(part.width, 21);
  EXPECT_EQ(part.height, 43);
  // The first pixel of the part is pixel (10, 5) of the image.
  EXPECT_DOUBLE_EQ((0.5 - part.cx) / part.fx, (10.5 - camera.cx) / camera.fx);
  EXPECT_DOUBLE_EQ((0.5 - part.cy) / part.fy, (5.5 - camera.cy) / camera.fy);
  EXPECT_EQ(part.world_from_camera.matrix(), camera.world_from_camera.matrix());
}

TEST(Cropped, RejectsPartsOutside) {
  const Camera camera = camera_from_fov(64, 48, 1.1);
  EXPECT_EQ(error_of([&] { cropped(camera, 3, 0, 3, 9); }),
            "cropped: the part must lie in the image and must not be empty, got columns 3 to 3 and "
            "rows 0 to 9");
  EXPECT_THAT(error_of([&] { cropped(camera, -1, 0, 3, 9); }), HasSubstr("columns -1 to 3"));
  EXPECT_THAT(error_of([&] { cropped(camera, 0, 0, 65, 9); }), HasSubstr("columns 0 to 65"));
  EXPECT_THAT(error_of([&] { cropped(camera, 0, 9, 3, 2); }), HasSubstr("rows 9 to 2"));
}

TEST(LookAt, TakesOtherUpDirections) {
  const Eigen::Isometry3d pose = look_at({0, 0, 0}, {0, 0, -1}, {0, 1, 0});
  EXPECT_NEAR((pose.linear().col(0) - Vector3d(1, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((pose.linear().col(1) - Vector3d(0, -1, 0)).norm(), 0, 1e-15);
  // Only the direction counts.
  EXPECT_TRUE(look_at({0, 0, 0}, {0, 0, -1}, {0, 1e-200, 0}).isApprox(pose, 1e-14));
}

TEST(LookAt, RejectsDegenerateViews) {
  const Vector3d eye(1, 2, 3);
  EXPECT_THAT(error_of([&] { look_at(eye, eye); }), HasSubstr("look_at: target must differ"));
  EXPECT_THAT(error_of([&] { look_at(eye, {1, 2, 9}); }), HasSubstr("look_at: up"));
  EXPECT_THAT(error_of([&] { look_at(eye, {1, 2, -9}); }), HasSubstr("look_at: up"));
  EXPECT_THAT(error_of([&] { look_at(eye, {5, 2, 3}, Vector3d::Zero()); }), HasSubstr("up"));
  EXPECT_EQ(error_of([&] {
              look_at({kNan, 0, 0}, eye);
            }),
            "look_at: eye must be finite, got [nan, 0, 0]");
  EXPECT_THAT(error_of([&] { look_at(eye, {0, kInf, 0}); }), HasSubstr("look_at: target"));
  EXPECT_THAT(error_of([&] { look_at(eye, {0, 0, 0}, {0, kNan, 1}); }), HasSubstr("look_at: up"));
}

}  // namespace
}  // namespace gslts
