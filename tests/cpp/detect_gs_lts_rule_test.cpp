#include <gmock/gmock.h>

#include <limits>

#include "detect_scenes.hpp"
#include "gslts/detect/gs_lts_rule.hpp"

namespace gslts::detect {
namespace {

using ::testing::HasSubstr;
using testing::ImagePair;
using In = ImagePair::In;

/// Thresholds that the images of these tests are far from.
GsLtsRule plain_rule() {
  GsLtsRule rule;
  rule.tau_change = 0.002;
  rule.tau_a = 0.5;
  rule.tau_d = 0.5;
  rule.epsilon = 0.05;
  return rule;
}

std::optional<GsLtsChange> detect(const ImagePair& pair, const GsLtsRule& rule = plain_rule()) {
  const Views views = pair.views();
  MaskRule mask;
  mask.clean_px = 1;
  const Masks masks = compute_masks(views, mask);
  return detect_gs_lts(
      views, connected_components(masks.combined.data(), ImagePair::kWidth, ImagePair::kHeight),
      rule);
}

TEST(GsLtsRule, EqualImagesAreNoChange) { EXPECT_FALSE(detect({})); }

TEST(GsLtsRule, NearerDepthIsAnAddition) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const auto change = detect(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kAddition);
  // The centroid is pixel (110, 45), and the pseudo depth the nearer one.
  const Eigen::Vector3d expected((110.0 - 80) / 160 * 1.5, (45.0 - 60) / 160 * 1.5, 1.5);
  EXPECT_LT((change->point_in_world - expected).norm(), 1e-6);
  EXPECT_FALSE(change->second);
}

TEST(GsLtsRule, FartherDepthIsARemovalAtTheDepthOfTheMap) {
  ImagePair pair;
  pair.put(In::kMap, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const auto change = detect(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kRemoval);
  EXPECT_NEAR(change->point_in_world.z(), 1.5, 1e-6);
}

TEST(GsLtsRule, DepthWithinEpsilonIsNoChange) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 20, 10, 1.96f, 1, 0, 0);
  EXPECT_FALSE(detect(pair));
  GsLtsRule strict = plain_rule();
  strict.epsilon = 0.03;
  EXPECT_TRUE(detect(pair, strict));
}

TEST(GsLtsRule, TwoRegionsOfSimilarAreaAreARelocation) {
  ImagePair pair;
  pair.put(In::kMap, 30, 40, 20, 10, 1.5f, 1, 0, 0);
  pair.put(In::kFrame, 70, 40, 20, 12, 1.0f, 1, 0, 0);
  const auto change = detect(pair);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->type, ChangeType::kRelocation);
  ASSERT_TRUE(change->second);
  EXPECT_GT(change->first.area, change->second->area);
  // Image coordinates and pseudo depth are averaged, then transformed to the world.
  const double u = (80 + 40) / 2.0, v = (46 + 45) / 2.0, z = (1.0 + 1.5) / 2;
  const Eigen::Vector3d expected((u - 80) / 160 * z, (v - 60) / 160 * z, z);
  EXPECT_LT((change->point_in_world - expected).norm(), 1e-6);
}

TEST(GsLtsRule, DifferentAreasOrFarRegionsAreNoRelocation) {
  ImagePair different;
  different.put(In::kMap, 30, 40, 20, 10, 1.5f, 1, 0, 0);
  different.put(In::kFrame, 70, 40, 20, 25, 1.0f, 1, 0, 0);
  EXPECT_EQ(detect(different)->type, ChangeType::kAddition);
  ImagePair far;
  far.put(In::kMap, 5, 40, 20, 10, 1.5f, 1, 0, 0);
  far.put(In::kFrame, 130, 40, 20, 12, 1.0f, 1, 0, 0);
  EXPECT_EQ(detect(far)->type, ChangeType::kAddition);
  GsLtsRule wide = plain_rule();
  wide.tau_d = 1;
  EXPECT_EQ(detect(far, wide)->type, ChangeType::kRelocation);
}

TEST(GsLtsRule, SmallRegionsAreNoChange) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 6, 6, 1.5f, 1, 0, 0);
  EXPECT_FALSE(detect(pair));
  GsLtsRule strict = plain_rule();
  strict.tau_change = 0.0005;
  EXPECT_TRUE(detect(pair, strict));
}

TEST(GsLtsRule, MissingDepthAtTheCentroidIsNoDifference) {
  for (const float missing : {0.0f, std::numeric_limits<float>::quiet_NaN()}) {
    ImagePair pair;
    pair.put(In::kFrame, 100, 40, 20, 10, missing, 1, 0, 0);
    EXPECT_FALSE(detect(pair));
    // Of a relocation, the depth that is there counts.
    pair.put(In::kMap, 70, 40, 20, 10, 1.5f, 1, 0, 0);
    const auto change = detect(pair);
    ASSERT_TRUE(change);
    EXPECT_EQ(change->type, ChangeType::kRelocation);
    EXPECT_NEAR(change->point_in_world.z(), (ImagePair::kWall_m + 1.5) / 2, 1e-6);
  }
}

TEST(GsLtsRule, ThePointMovesWithTheCamera) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 20, 10, 1.5f, 1, 0, 0);
  const Eigen::Vector3d at_origin = detect(pair)->point_in_world;
  pair.camera.world_from_camera.rotate(
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  pair.camera.world_from_camera.pretranslate(Eigen::Vector3d(4, 5, 6));
  const Eigen::Vector3d expected = pair.camera.world_from_camera * at_origin;
  EXPECT_LT((detect(pair)->point_in_world - expected).norm(), 1e-9);
}

TEST(GsLtsRule, InvalidThresholdsAreNamed) {
  GsLtsRule rule;
  rule.tau_a = 2;
  try {
    detect({}, rule);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("detect_gs_lts: tau_a must be in [0, 1], got 2"));
  }
}

}  // namespace
}  // namespace gslts::detect
