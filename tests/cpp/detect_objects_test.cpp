#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "detect_scenes.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::detect {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using testing::ImagePair;
using In = ImagePair::In;

struct Found {
  std::vector<ObjectChange> changes;
  Array<std::int32_t> labels;
};

Found find_in(const ImagePair& pair, const ObjectRule& rule = {}) {
  const Views views = pair.views();
  Surfaces found = find_changed_surfaces(views, compute_masks(views, {}), rule);
  return {classify_changes(found.surfaces, rule), std::move(found.labels)};
}

TEST(Objects, EqualImagesHaveNoChange) {
  const Found found = find_in({});
  EXPECT_TRUE(found.changes.empty());
  EXPECT_THAT(found.labels, Each(0));
}

TEST(Objects, NearerSurfaceInTheFrameIsAnAddition) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  const Found found = find_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  const ObjectChange& change = found.changes[0];
  EXPECT_EQ(change.type, ChangeType::kAddition);
  EXPECT_FALSE(change.before);
  ASSERT_TRUE(change.after);
  EXPECT_NEAR(change.after->point.x(), (110.0 - 80) / 160 * 1.6, 0.01);
  EXPECT_NEAR(change.after->point.y(), (45.0 - 60) / 160 * 1.6, 0.01);
  EXPECT_NEAR(change.after->point.z(), 1.6, 1e-6);
  EXPECT_NEAR(change.after->area_m2, 200 * 1.6 * 1.6 / (160 * 160), 5e-4);
  EXPECT_NEAR(change.after->step_m, 0.4, 1e-6);
  EXPECT_NEAR(change.after->color.x(), 0.8, 1e-6);
  EXPECT_GT(change.confidence, 0.8);
  const auto drawn = std::count(found.labels.begin(), found.labels.end(), change.after->label);
  EXPECT_NEAR(double(drawn), 200, 4);
}

TEST(Objects, NearerSurfaceInTheMapIsARemoval) {
  ImagePair pair;
  pair.put(In::kMap, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  const Found found = find_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kRemoval);
  ASSERT_TRUE(found.changes[0].before);
  EXPECT_NEAR(found.changes[0].before->point.z(), 1.6, 1e-6);
}

TEST(Objects, DepthStepNeedsNoColourChange) {
  ImagePair pair;
  pair.put(In::kFrame, 100, 40, 20, 10, 1.6f, 0.5f, 0.5f, 0.5f);
  pair.similarity.assign(pair.similarity.size(), 1.0f);
  EXPECT_EQ(find_in(pair).changes.size(), 1u);
}

TEST(Objects, MatchingEndsAreOneRelocation) {
  ImagePair pair;
  pair.put(In::kMap, 20, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  // Nearer and thus larger in the image, of the same size in the world.
  pair.put(In::kFrame, 90, 60, 25, 12, 1.3f, 0.8f, 0.2f, 0.2f);
  const Found found = find_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kRelocation);
  EXPECT_NEAR(found.changes[0].before->point.z(), 1.6, 1e-6);
  EXPECT_NEAR(found.changes[0].after->point.z(), 1.3, 1e-6);
}

TEST(Objects, DifferentEndsAreTwoChanges) {
  for (const bool other_color : {false, true}) {
    ImagePair pair;
    pair.put(In::kMap, 20, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    const int height = other_color ? 10 : 115;
    const float red = other_color ? 0.1f : 0.8f, blue = other_color ? 0.9f : 0.2f;
    pair.put(In::kFrame, 90, 2, other_color ? 20 : 60, height, 1.6f, red, 0.2f, blue);
    const Found found = find_in(pair);
    ASSERT_EQ(found.changes.size(), 2u) << other_color;
    std::vector<ChangeType> types{found.changes[0].type, found.changes[1].type};
    EXPECT_THAT(types,
                ::testing::UnorderedElementsAre(ChangeType::kAddition, ChangeType::kRemoval));
  }
}

TEST(Objects, SeveralChangesAtOnce) {
  ImagePair pair;
  pair.put(In::kMap, 10, 20, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kFrame, 60, 20, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 110, 20, 14, 14, 1.5f, 0.1f, 0.1f, 0.9f);
  pair.put(In::kFrame, 30, 80, 30, 20, 1.8f, 0.1f, 0.9f, 0.1f);
  const Found found = find_in(pair);
  std::vector<ChangeType> types;
  for (const ObjectChange& change : found.changes) types.push_back(change.type);
  EXPECT_THAT(types, ::testing::UnorderedElementsAre(ChangeType::kRelocation, ChangeType::kRemoval,
                                                     ChangeType::kAddition));
}

TEST(Objects, FlatObjectIsInTheImageWithItsColours) {
  for (const In where : {In::kFrame, In::kMap}) {
    ImagePair pair;
    pair.put(where, 60, 40, 30, 20, ImagePair::kWall_m, 0.9f, 0.1f, 0.1f);
    const Found found = find_in(pair);
    ASSERT_EQ(found.changes.size(), 1u);
    const ObjectChange& change = found.changes[0];
    EXPECT_EQ(change.type, where == In::kFrame ? ChangeType::kAddition : ChangeType::kRemoval);
    EXPECT_TRUE((change.after ? change.after : change.before)->flat);
  }
}

TEST(Objects, FlatObjectIsInTheImageWithTheNearerSurface) {
  ImagePair pair;  // An object of 1 cm, as strong in colour as what it hides.
  pair.put(In::kMap, 60, 40, 30, 20, ImagePair::kWall_m, 0.9f, 0.1f, 0.1f);
  pair.put(In::kFrame, 60, 40, 30, 20, ImagePair::kWall_m - 0.01f, 0.1f, 0.1f, 0.9f);
  const Found found = find_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kAddition);
}

TEST(Objects, UnknownPixelsAndMissingDepthAreNoChange) {
  ImagePair unknown;
  unknown.put(In::kFrame, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  unknown.alpha.assign(unknown.alpha.size(), 0.4f);
  EXPECT_TRUE(find_in(unknown).changes.empty());
  ImagePair unmeasured;
  unmeasured.put(In::kFrame, 100, 40, 20, 10, 0.0f, 0.5f, 0.5f, 0.5f);
  EXPECT_TRUE(find_in(unmeasured).changes.empty());
}

TEST(Objects, FlatSurfaceBeforeNothingMeasuredIsNoRemoval) {
  for (const int measured : {0, 8, 24, 30}) {  // Columns of the object's 30.
    ImagePair pair;
    pair.put(In::kMap, 60, 40, 30, 20, ImagePair::kWall_m, 0.9f, 0.1f, 0.1f);
    pair.put(In::kFrame, 60 + measured, 40, 30 - measured, 20, 0.0f, 0.5f, 0.5f, 0.5f);
    EXPECT_EQ(find_in(pair).changes.size(), measured < 15 ? 0u : 1u) << measured;
  }
}

TEST(Objects, StepsToTheLargestDepthsAreFinite) {
  ImagePair pair;
  pair.put(In::kMap, 60, 40, 30, 20, 1.6f, 0.9f, 0.1f, 0.1f);
  pair.put(In::kFrame, 60, 40, 30, 20, 1e38f, 0.5f, 0.5f, 0.5f);
  Views views = pair.views();
  views.noise = {0.008, 0};
  const Surfaces found = find_changed_surfaces(views, compute_masks(views, {}), {});
  ASSERT_EQ(found.surfaces.size(), 1u);
  validate(found.surfaces[0], "test");
}

TEST(Objects, MisplacedEdgesAreNoChange) {
  ImagePair pair;
  pair.put(In::kMap, 60, 40, 30, 30, 1.2f, 0.9f, 0.1f, 0.1f);
  pair.put(In::kFrame, 62, 41, 30, 30, 1.2f, 0.9f, 0.1f, 0.1f);
  EXPECT_TRUE(find_in(pair).changes.empty());
}

TEST(Objects, SensorNoiseIsNoChange) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 1);
  ImagePair pair;
  for (float& depth : pair.observed_depth) {
    depth += (0.0012f + 0.0019f * (depth - 0.4f) * (depth - 0.4f)) * noise(random);
  }
  for (float& color : pair.observed_rgb) color += 0.01f * noise(random);
  EXPECT_TRUE(find_in(pair).changes.empty());
}

TEST(Objects, ShiftingBothImagesShiftsTheResult) {
  const auto at = [](int x, int y) {
    ImagePair pair;
    pair.put(In::kMap, x, y, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    pair.put(In::kFrame, x + 50, y + 20, 18, 12, 1.7f, 0.2f, 0.8f, 0.2f);
    return find_in(pair);
  };
  const Found first = at(10, 10), second = at(17, 33);
  ASSERT_EQ(first.changes.size(), 2u);
  ASSERT_EQ(second.changes.size(), 2u);
  for (std::size_t k = 0; k < first.labels.size(); ++k) {
    const std::size_t shifted = k + 23 * ImagePair::kWidth + 7;
    if (first.labels[k] != 0) {
      ASSERT_EQ(second.labels[shifted], first.labels[k]);
    }
  }
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(first.changes[k].type, second.changes[k].type);
    EXPECT_DOUBLE_EQ(first.changes[k].confidence, second.changes[k].confidence);
  }
}

TEST(Objects, InvalidSettingsAreNamed) {
  ObjectRule rule;
  rule.min_match_score = -1;
  try {
    find_in({}, rule);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("find_changed_surfaces: min_match_score must be in [0, 1], got -1"));
  }
}

}  // namespace
}  // namespace gslts::detect
