#include <gmock/gmock.h>

#include <limits>

#include "detect_scenes.hpp"
#include "gslts/detect/paper_rule.hpp"

namespace gslts::detect {
namespace {

using ::testing::HasSubstr;
using testing::Pair;
using In = Pair::In;

/// Thresholds that the images of these tests are far from.
PaperRule plain_rule() {
  PaperRule rule;
  rule.tau_change = 0.002;
  rule.tau_a = 0.5;
  rule.tau_d = 0.5;
  rule.epsilon = 0.05;
  return rule;
}

std::optional<PaperChange> judged(const Pair& pair, const PaperRule& rule = plain_rule()) {
  const Views views = pair.views();
  MaskRule mask;
  mask.clean_px = 1;
  const Masks masks = masks_of(views, mask);
  return paper_change(views, components_of(masks.combined.data(), Pair::kWidth, Pair::kHeight),
                      rule);
}

TEST(PaperRule, NothingDiffers) { EXPECT_FALSE(judged({})); }

TEST(PaperRule, WhatIsNearerWasAdded) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const auto change = judged(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kAddition);
  // The centroid is pixel (110, 45), and the pseudo depth the nearer one.
  const Eigen::Vector3d expected((110.0 - 80) / 160 * 1.5, (45.0 - 60) / 160 * 1.5, 1.5);
  EXPECT_LT((change->point_in_world - expected).norm(), 1e-6);
  EXPECT_FALSE(change->second);
}

TEST(PaperRule, WhatIsFartherWasRemovedAndLooksAreAskedOfTheMap) {
  Pair pair;
  pair.put(In::kMap, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const auto change = judged(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kRemoval);
  EXPECT_NEAR(change->point_in_world.z(), 1.5, 1e-6);
}

TEST(PaperRule, WithinEpsilonNothingChanged) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 20, 10, 1.96f, 1, 0, 0);
  EXPECT_FALSE(judged(pair));
  PaperRule strict = plain_rule();
  strict.epsilon = 0.03;
  EXPECT_TRUE(judged(pair, strict));
}

TEST(PaperRule, TwoRegionsOfLikeAreaAreARelocationToBetweenThem) {
  Pair pair;
  pair.put(In::kMap, 30, 40, 20, 10, 1.5f, 1, 0, 0);
  pair.put(In::kPhoto, 70, 40, 20, 12, 1.0f, 1, 0, 0);
  const auto change = judged(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kRelocation);
  ASSERT_TRUE(change->second);
  EXPECT_GT(change->first.area, change->second->area);
  // Image place and pseudo depth are averaged, then carried to the world.
  const double u = (80 + 40) / 2.0, v = (46 + 45) / 2.0, z = (1.0 + 1.5) / 2;
  const Eigen::Vector3d expected((u - 80) / 160 * z, (v - 60) / 160 * z, z);
  EXPECT_LT((change->point_in_world - expected).norm(), 1e-6);
}

TEST(PaperRule, UnlikeAreasOrFarRegionsAreNoRelocation) {
  Pair unlike;
  unlike.put(In::kMap, 30, 40, 20, 10, 1.5f, 1, 0, 0);
  unlike.put(In::kPhoto, 70, 40, 20, 25, 1.0f, 1, 0, 0);
  EXPECT_EQ(judged(unlike)->type, ChangeType::kAddition);
  Pair far;
  far.put(In::kMap, 5, 40, 20, 10, 1.5f, 1, 0, 0);
  far.put(In::kPhoto, 130, 40, 20, 12, 1.0f, 1, 0, 0);
  EXPECT_EQ(judged(far)->type, ChangeType::kAddition);
  PaperRule wide = plain_rule();
  wide.tau_d = 1;
  EXPECT_EQ(judged(far, wide)->type, ChangeType::kRelocation);
}

TEST(PaperRule, SmallDifferencesAreNoChange) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 6, 6, 1.5f, 1, 0, 0);
  EXPECT_FALSE(judged(pair));
  PaperRule strict = plain_rule();
  strict.tau_change = 0.0005;
  EXPECT_TRUE(judged(pair, strict));
}

TEST(PaperRule, MissingDepthAtTheCentroidIsNoDifference) {
  for (const float none : {0.0f, std::numeric_limits<float>::quiet_NaN()}) {
    Pair pair;
    pair.put(In::kPhoto, 100, 40, 20, 10, none, 1, 0, 0);
    EXPECT_FALSE(judged(pair));
    // Of a relocation, the depth that is there counts.
    pair.put(In::kMap, 70, 40, 20, 10, 1.5f, 1, 0, 0);
    const auto change = judged(pair);
    ASSERT_TRUE(change);
    EXPECT_EQ(change->type, ChangeType::kRelocation);
    EXPECT_NEAR(change->point_in_world.z(), (Pair::kWall_m + 1.5) / 2, 1e-6);
  }
}

TEST(PaperRule, ThePointMovesWithTheCamera) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const Eigen::Vector3d at_home = judged(pair)->point_in_world;
  pair.camera.world_from_camera.rotate(
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  pair.camera.world_from_camera.pretranslate(Eigen::Vector3d(4, 5, 6));
  const Eigen::Vector3d expected = pair.camera.world_from_camera * at_home;
  EXPECT_LT((judged(pair)->point_in_world - expected).norm(), 1e-9);
}

TEST(PaperRule, BadThresholdsAreNamed) {
  PaperRule rule;
  rule.tau_a = 2;
  try {
    judged({}, rule);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("paper_change: tau_a must be in [0, 1], got 2"));
  }
}

}  // namespace
}  // namespace gslts::detect
