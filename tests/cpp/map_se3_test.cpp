#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "gslts/map/se3.hpp"

namespace gslts {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Vector3d kA(0.3, -0.2, 0.5), kB(1, 2, -3);

TEST(Se3, CrossMatrixIsTheCrossProduct) {
  EXPECT_LT((cross_matrix(kA) * kB - kA.cross(kB)).norm(), 1e-15);
}

TEST(Se3, RotationTurnsAboutItsVector) {
  EXPECT_EQ(rotation_from_vector(Vector3d::Zero()), Matrix3d::Identity());
  EXPECT_LT((rotation_from_vector(kA) * kA - kA).norm(), 1e-15);
  const Vector3d quarter(0, 0, std::acos(-1.0) / 2);
  EXPECT_LT((rotation_from_vector(quarter) * Vector3d::UnitX() - Vector3d::UnitY()).norm(), 1e-15);
}

TEST(Se3, RightJacobianIsThatOfDifferences) {
  for (const Vector3d& phi : {kA, Vector3d(1e-8, 0, 0), Vector3d(1.5, 1, -1)}) {
    constexpr double kStep = 1e-6;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d step = kStep * Vector3d::Unit(axis);
      const Matrix3d turn =
          rotation_from_vector(phi).transpose() * rotation_from_vector(phi + step);
      const Vector3d expected = right_jacobian(phi).col(axis);
      EXPECT_LT((turn - Matrix3d::Identity() - kStep * cross_matrix(expected)).norm(), 1e-11);
    }
  }
}

TEST(Se3, RetractMovesInTheCameraFrame) {
  Vector6 twist;
  twist << kB, kA;
  const Eigen::Isometry3d pose = se3_retract(Eigen::Isometry3d::Identity(), twist);
  EXPECT_EQ(pose.translation(), kB);
  EXPECT_EQ(pose.linear(), rotation_from_vector(kA));
  const Eigen::Isometry3d next = se3_retract(pose, twist);
  EXPECT_LT((next.translation() - (kB + rotation_from_vector(kA) * kB)).norm(), 1e-14);
}

TEST(Se3, PoseDistanceIsInMetresAndRadians) {
  Vector6 twist;
  twist << kB, kA;
  const Eigen::Isometry3d pose = se3_retract(Eigen::Isometry3d::Identity(), Vector6::Ones());
  const PoseDistance distance = pose_distance(se3_retract(pose, twist), pose);
  EXPECT_NEAR(distance.m, kB.norm(), 1e-14);
  EXPECT_NEAR(distance.rad, kA.norm(), 1e-14);
}

TEST(Se3, OnlyRotationsAreRotations) {
  EXPECT_TRUE(is_rotation(rotation_from_vector(kA)));
  EXPECT_FALSE(is_rotation(1.001 * Matrix3d::Identity()));
  EXPECT_FALSE(is_rotation(Vector3d(1, 1, -1).asDiagonal().toDenseMatrix()));
  Matrix3d matrix = Matrix3d::Identity();
  matrix(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_rotation(matrix));
}

}  // namespace
}  // namespace gslts
