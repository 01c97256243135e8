#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "detect_scenes.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::detect {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using testing::Pair;
using In = Pair::In;

struct Found {
  std::vector<ObjectChange> changes;
  Array<std::int32_t> labels;
};

Found found_in(const Pair& pair, const ObjectRule& rule = {}) {
  const Views views = pair.views();
  Surfaces found = changed_surfaces(views, masks_of(views, {}), rule);
  return {changes_of(found.surfaces, rule), std::move(found.labels)};
}

TEST(Objects, NothingChanges) {
  const Found found = found_in({});
  EXPECT_TRUE(found.changes.empty());
  EXPECT_THAT(found.labels, Each(0));
}

TEST(Objects, WhatAppearsIsAnAdditionWithItsBox) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  const Found found = found_in(pair);
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

TEST(Objects, WhatVanishesIsARemoval) {
  Pair pair;
  pair.put(In::kMap, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  const Found found = found_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kRemoval);
  ASSERT_TRUE(found.changes[0].before);
  EXPECT_NEAR(found.changes[0].before->point.z(), 1.6, 1e-6);
}

TEST(Objects, ColoursAreNotNeededWhereDepthTells) {
  Pair pair;
  pair.put(In::kPhoto, 100, 40, 20, 10, 1.6f, 0.5f, 0.5f, 0.5f);
  pair.similarity.assign(pair.similarity.size(), 1.0f);
  EXPECT_EQ(found_in(pair).changes.size(), 1u);
}

TEST(Objects, AlikeEndsAreOneRelocation) {
  Pair pair;
  pair.put(In::kMap, 20, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  // Nearer and thus larger in the image, of the same size in the world.
  pair.put(In::kPhoto, 90, 60, 25, 12, 1.3f, 0.8f, 0.2f, 0.2f);
  const Found found = found_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kRelocation);
  EXPECT_NEAR(found.changes[0].before->point.z(), 1.6, 1e-6);
  EXPECT_NEAR(found.changes[0].after->point.z(), 1.3, 1e-6);
}

TEST(Objects, UnlikeEndsAreTwoChanges) {
  for (const bool other_color : {false, true}) {
    Pair pair;
    pair.put(In::kMap, 20, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    const int height = other_color ? 10 : 115;
    const float red = other_color ? 0.1f : 0.8f, blue = other_color ? 0.9f : 0.2f;
    pair.put(In::kPhoto, 90, 2, other_color ? 20 : 60, height, 1.6f, red, 0.2f, blue);
    const Found found = found_in(pair);
    ASSERT_EQ(found.changes.size(), 2u) << other_color;
    std::vector<ChangeType> types{found.changes[0].type, found.changes[1].type};
    EXPECT_THAT(types,
                ::testing::UnorderedElementsAre(ChangeType::kAddition, ChangeType::kRemoval));
  }
}

TEST(Objects, SeveralChangesAtOnce) {
  Pair pair;
  pair.put(In::kMap, 10, 20, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kPhoto, 60, 20, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 110, 20, 14, 14, 1.5f, 0.1f, 0.1f, 0.9f);
  pair.put(In::kPhoto, 30, 80, 30, 20, 1.8f, 0.1f, 0.9f, 0.1f);
  const Found found = found_in(pair);
  std::vector<ChangeType> types;
  for (const ObjectChange& one : found.changes) types.push_back(one.type);
  EXPECT_THAT(types, ::testing::UnorderedElementsAre(ChangeType::kRelocation, ChangeType::kRemoval,
                                                     ChangeType::kAddition));
}

TEST(Objects, AFlatThingIsWhereItStandsOut) {
  for (const In where : {In::kPhoto, In::kMap}) {
    Pair pair;
    pair.put(where, 60, 40, 30, 20, Pair::kWall_m, 0.9f, 0.1f, 0.1f);
    const Found found = found_in(pair);
    ASSERT_EQ(found.changes.size(), 1u);
    const ObjectChange& change = found.changes[0];
    EXPECT_EQ(change.type, where == In::kPhoto ? ChangeType::kAddition : ChangeType::kRemoval);
    EXPECT_TRUE((change.after ? change.after : change.before)->flat);
  }
}

TEST(Objects, AFlatThingIsWhereItRaisesTheSurface) {
  Pair pair;  // A thing of 1 cm, as strong in colour as what it hides.
  pair.put(In::kMap, 60, 40, 30, 20, Pair::kWall_m, 0.9f, 0.1f, 0.1f);
  pair.put(In::kPhoto, 60, 40, 30, 20, Pair::kWall_m - 0.01f, 0.1f, 0.1f, 0.9f);
  const Found found = found_in(pair);
  ASSERT_EQ(found.changes.size(), 1u);
  EXPECT_EQ(found.changes[0].type, ChangeType::kAddition);
}

TEST(Objects, UnknownPlacesAndMissingDepthAreNoChange) {
  Pair unknown;
  unknown.put(In::kPhoto, 100, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  unknown.alpha.assign(unknown.alpha.size(), 0.4f);
  EXPECT_TRUE(found_in(unknown).changes.empty());
  Pair unmeasured;
  unmeasured.put(In::kPhoto, 100, 40, 20, 10, 0.0f, 0.5f, 0.5f, 0.5f);
  EXPECT_TRUE(found_in(unmeasured).changes.empty());
}

TEST(Objects, EdgesMayStandALittleBesideTheirPlace) {
  Pair pair;
  pair.put(In::kMap, 60, 40, 30, 30, 1.2f, 0.9f, 0.1f, 0.1f);
  pair.put(In::kPhoto, 62, 41, 30, 30, 1.2f, 0.9f, 0.1f, 0.1f);
  EXPECT_TRUE(found_in(pair).changes.empty());
}

TEST(Objects, NoiseOfTheSensorIsNoChange) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 1);
  Pair pair;
  for (float& depth : pair.measured) {
    depth += (0.0012f + 0.0019f * (depth - 0.4f) * (depth - 0.4f)) * noise(random);
  }
  for (float& color : pair.photo) color += 0.01f * noise(random);
  EXPECT_TRUE(found_in(pair).changes.empty());
}

TEST(Objects, ShiftingBothImagesShiftsTheResult) {
  const auto at = [](int x, int y) {
    Pair pair;
    pair.put(In::kMap, x, y, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    pair.put(In::kPhoto, x + 50, y + 20, 18, 12, 1.7f, 0.2f, 0.8f, 0.2f);
    return found_in(pair);
  };
  const Found first = at(10, 10), second = at(17, 33);
  ASSERT_EQ(first.changes.size(), 2u);
  ASSERT_EQ(second.changes.size(), 2u);
  for (std::size_t k = 0; k < first.labels.size(); ++k) {
    const std::size_t moved = k + 23 * Pair::kWidth + 7;
    if (first.labels[k] != 0) {
      ASSERT_EQ(second.labels[moved], first.labels[k]);
    }
  }
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(first.changes[k].type, second.changes[k].type);
    EXPECT_DOUBLE_EQ(first.changes[k].confidence, second.changes[k].confidence);
  }
}

TEST(Objects, BadSettingsAreNamed) {
  ObjectRule rule;
  rule.alike = -1;
  try {
    found_in({}, rule);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("changed_surfaces: alike must be in [0, 1], got -1"));
  }
}

}  // namespace
}  // namespace gslts::detect
