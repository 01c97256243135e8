#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "detect_scenes.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/shifts.hpp"

namespace gslts::detect {
namespace {

using testing::ImagePair;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using In = ImagePair::In;

/// A rectangle facing the camera, world axes, which here are those of the camera.
struct Plate {
  Eigen::Vector2d center_m, size_m;
  double depth_m;
  double yaw_rad;
  std::array<float, 3> color;

  Plate moved(double x_m, double y_m, double yaw) const {
    Plate other = *this;
    other.center_m += Eigen::Vector2d(x_m, y_m);
    other.yaw_rad += yaw;
    return other;
  }

  bool contains(const Eigen::Vector2d& point_m) const {
    const Eigen::Vector2d local = Eigen::Rotation2Dd(-yaw_rad) * (point_m - center_m);
    return (local.cwiseAbs() - size_m / 2).maxCoeff() <= 0;
  }
};

void draw(ImagePair& pair, In where, const Plate& plate) {
  const Camera& camera = pair.camera;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d ray((x + 0.5 - camera.cx) / camera.fx,
                                (y + 0.5 - camera.cy) / camera.fy);
      if (!plate.contains(ray * plate.depth_m)) continue;
      const auto [red, green, blue] = plate.color;
      pair.put(where, x, y, 1, 1, float(plate.depth_m), red, green, blue);
    }
  }
}

std::vector<Shift> shifts_in(const ImagePair& pair) {
  const Views views = pair.views();
  const Masks masks = compute_masks(views, {});
  const Surfaces found = find_changed_surfaces(views, masks, {});
  return find_shifts(views, masks, found.surfaces, found.labels, {});
}

double yaw_of(const Eigen::Isometry3d& motion) {
  return std::atan2(motion.linear()(1, 0), motion.linear()(0, 0));
}

const Plate kTable{{-0.05, 0.02}, {0.5, 0.4}, 1.5, 0.1, {0.8f, 0.2f, 0.2f}};
const Plate kMug{{-0.1, 0.05}, {0.12, 0.12}, 1.3, 0.3, {0.2f, 0.7f, 0.3f}};

TEST(Shifts, EqualImagesHaveNone) { EXPECT_THAT(shifts_in({}), IsEmpty()); }

TEST(Shifts, NudgedObjectIsOneShiftWithItsMotion) {
  ImagePair pair;
  draw(pair, In::kMap, kTable);
  draw(pair, In::kFrame, kTable.moved(0.06, -0.04, 0));
  const std::vector<Shift> shifts = shifts_in(pair);
  ASSERT_THAT(shifts, SizeIs(1));
  EXPECT_NEAR(shifts[0].motion.translation().x(), 0.06, 0.01);
  EXPECT_NEAR(shifts[0].motion.translation().y(), -0.04, 0.01);
  EXPECT_EQ(shifts[0].motion.translation().z(), 0);
  EXPECT_GE(shifts[0].surfaces.size(), 2u);  // One on each side of the object.
  EXPECT_GT(shifts[0].score, 0.7);
}

TEST(Shifts, BoxesHoldTheObjectBeforeAndAfter) {
  ImagePair pair;
  draw(pair, In::kMap, kTable);
  draw(pair, In::kFrame, kTable.moved(0.08, 0, 0));
  const std::vector<Shift> shifts = shifts_in(pair);
  ASSERT_THAT(shifts, SizeIs(1));
  const Eigen::AlignedBox3d &before = shifts[0].before, &after = shifts[0].after;
  EXPECT_NEAR(before.min().x(), -0.3, 0.04);  // Corners turned by 0.1 rad are not followed.
  EXPECT_NEAR(after.max().x(), 0.28, 0.04);
  EXPECT_NEAR(before.min().z(), 1.5, 1e-6);
}

TEST(Shifts, WhatStandsOnTheObjectMovesWithIt) {
  ImagePair pair;
  for (const Plate& plate : {kTable, kMug}) {
    draw(pair, In::kMap, plate);
    draw(pair, In::kFrame, plate.moved(0.07, 0.03, 0));
  }
  const std::vector<Shift> shifts = shifts_in(pair);
  ASSERT_THAT(shifts, SizeIs(1));
  EXPECT_NEAR(shifts[0].before.min().z(), 1.3, 1e-6);  // The mug belongs to it.
}

TEST(Shifts, RandomMotionsAreFound) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-0.1, 0.1), size(0.3, 0.5), angle(0, 2 * M_PI),
      length(0.05, 0.11), turn(-0.09, 0.09);
  for (int n = 0; n < 20; ++n) {
    SCOPED_TRACE(n);
    const Plate plate{{place(random), place(random)},
                      {size(random), size(random)},
                      1.5,
                      angle(random),
                      {0.8f, 0.2f, 0.2f}};
    const double way = length(random), direction = angle(random);
    const Plate moved =
        plate.moved(way * std::cos(direction), way * std::sin(direction), turn(random));
    ImagePair pair;
    draw(pair, In::kMap, plate);
    draw(pair, In::kFrame, moved);
    const std::vector<Shift> shifts = shifts_in(pair);
    ASSERT_THAT(shifts, SizeIs(1));
    const Eigen::Vector3d center(plate.center_m.x(), plate.center_m.y(), 1.5);
    const Eigen::Vector2d end = (shifts[0].motion * center).head<2>();
    EXPECT_LT((end - moved.center_m).norm(), 0.02);
    EXPECT_NEAR(yaw_of(shifts[0].motion), moved.yaw_rad - plate.yaw_rad, 0.06);
  }
}

TEST(Shifts, ObjectsThatCameOrWentHaveNone) {
  for (const In where : {In::kMap, In::kFrame}) {
    ImagePair pair;
    draw(pair, where, kTable);
    EXPECT_THAT(shifts_in(pair), IsEmpty());
  }
}

TEST(Shifts, ObjectThatWentBesideATwinHasNone) {
  const Plate left{{-0.15, 0}, {0.12, 0.2}, 1.5, 0, {0.8f, 0.2f, 0.2f}};
  const Plate right = left.moved(0.13, 0, 0);
  ImagePair pair;
  draw(pair, In::kMap, left);
  draw(pair, In::kMap, right);
  draw(pair, In::kFrame, right);
  EXPECT_THAT(shifts_in(pair), IsEmpty());
}

TEST(Shifts, ObjectThatMovedFartherHasNone) {
  const Plate box{{-0.4, 0}, {0.2, 0.2}, 1.5, 0, {0.8f, 0.2f, 0.2f}};
  ImagePair pair;
  draw(pair, In::kMap, box);
  draw(pair, In::kFrame, box.moved(0.5, 0.1, 0));
  EXPECT_THAT(shifts_in(pair), IsEmpty());
}

TEST(Shifts, ObjectOfAnotherColourInThePlaceHasNone) {
  Plate other = kTable.moved(0.06, 0, 0);
  other.color = {0.1f, 0.3f, 0.9f};
  ImagePair pair;
  draw(pair, In::kMap, kTable);
  draw(pair, In::kFrame, other);
  EXPECT_THAT(shifts_in(pair), IsEmpty());
}

TEST(Shifts, TwoObjectsAreTwoShifts) {
  const Plate left{{-0.4, 0}, {0.3, 0.3}, 1.5, 0, {0.8f, 0.2f, 0.2f}};
  const Plate right{{0.4, 0}, {0.3, 0.3}, 1.5, 0, {0.2f, 0.3f, 0.8f}};
  ImagePair pair;
  draw(pair, In::kMap, left);
  draw(pair, In::kMap, right);
  draw(pair, In::kFrame, left.moved(0, 0.08, 0));
  draw(pair, In::kFrame, right.moved(0, -0.08, 0));
  const std::vector<Shift> shifts = shifts_in(pair);
  ASSERT_THAT(shifts, SizeIs(2));
  EXPECT_LT(shifts[0].motion.translation().y() * shifts[1].motion.translation().y(), 0);
}

TEST(Shifts, RejectsABadCamera) {
  ImagePair pair;
  pair.camera.fx = 0;
  const Masks masks = compute_masks(ImagePair{}.views(), {});
  const Array<std::int32_t> labels(pair.views().size(), 0);
  EXPECT_THROW(find_shifts(pair.views(), masks, {}, labels, {}), std::invalid_argument);
}

}  // namespace
}  // namespace gslts::detect
