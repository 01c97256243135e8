#include <gmock/gmock.h>

#include <numeric>

#include "detect_scenes.hpp"
#include "gslts/detect/components.hpp"
#include "gslts/detect/masks.hpp"

namespace gslts::detect {
namespace {

using ::testing::Each;
using testing::ImagePair;
using In = ImagePair::In;

/// Thresholds that the images of these tests are far from.
MaskRule plain_rule() {
  MaskRule rule;
  rule.tau_gs = 0.25;
  rule.tau_feat = 0.75;
  rule.clean_px = 1;
  return rule;
}

int count(const Array<std::uint8_t>& mask) { return std::accumulate(mask.begin(), mask.end(), 0); }

TEST(Masks, ChangeNeedsDifferentColoursAndFeatures) {
  ImagePair pair;
  pair.put(In::kFrame, 20, 30, 40, 20, 2.0f, 0.8f, 0.5f, 0.5f);
  const Masks both = compute_masks(pair.views(), plain_rule());
  EXPECT_EQ(count(both.pixel), 800);
  EXPECT_EQ(count(both.feature), 800);
  EXPECT_NEAR(count(both.combined), 800, 4);  // Corners are rounded off.
  EXPECT_EQ(both.combined[std::size_t(40) * ImagePair::kWidth + 40], 1);
  pair.similarity.assign(pair.similarity.size(), 0.9f);
  EXPECT_THAT(compute_masks(pair.views(), plain_rule()).combined, Each(0));
  pair.similarity.assign(pair.similarity.size(), 0.0f);
  pair.observed_rgb = pair.rendered_rgb;
  EXPECT_THAT(compute_masks(pair.views(), plain_rule()).combined, Each(0));
}

TEST(Masks, ChannelDifferencesAddUp) {
  ImagePair pair;
  pair.put(In::kFrame, 20, 30, 40, 20, 2.0f, 0.6f, 0.4f, 0.6f);
  MaskRule rule = plain_rule();
  rule.tau_gs = 0.29;
  EXPECT_EQ(count(compute_masks(pair.views(), rule).pixel), 800);
  rule.tau_gs = 0.31;
  EXPECT_EQ(count(compute_masks(pair.views(), rule).pixel), 0);
}

TEST(Masks, UnknownPixelsAreNoChange) {
  ImagePair pair;
  pair.put(In::kFrame, 20, 30, 40, 20, 1.0f, 1, 0, 0);
  pair.alpha.assign(pair.alpha.size(), 0.3f);
  const Masks masks = compute_masks(pair.views(), plain_rule());
  EXPECT_THAT(masks.combined, Each(0));
  EXPECT_THAT(masks.known, Each(0));
}

TEST(Masks, SpecksAreRemovedAndCracksClosed) {
  ImagePair pair;
  pair.put(In::kFrame, 10, 10, 1, 1, 2.0f, 1, 0, 0);
  pair.put(In::kFrame, 40, 40, 20, 20, 2.0f, 1, 0, 0);
  pair.put(In::kFrame, 40, 50, 20, 1, 2.0f, 0.5f, 0.5f, 0.5f);  // A line as before.
  const Masks masks = compute_masks(pair.views(), plain_rule());
  const Components parts =
      connected_components(masks.combined.data(), ImagePair::kWidth, ImagePair::kHeight);
  ASSERT_EQ(parts.components.size(), 1u);
  EXPECT_NEAR(parts.components[0].area, 400, 12);  // Both halves lose corners.
}

TEST(Components, TheLargestComesFirstWithItsCentroid) {
  std::vector<std::uint8_t> mask(10 * 8, 0);
  const auto fill = [&mask](int x, int y, int width, int height) {
    for (int row = y; row < y + height; ++row) {
      for (int column = x; column < x + width; ++column) mask[std::size_t(row) * 10 + column] = 1;
    }
  };
  fill(0, 0, 2, 2);
  fill(5, 1, 4, 3);
  mask[std::size_t(2) * 10 + 2] = 1;  // Touches the first at its corner.
  fill(0, 6, 5, 1);
  const Components parts = connected_components(mask.data(), 10, 8);
  ASSERT_EQ(parts.components.size(), 3u);
  EXPECT_EQ(parts.components[0].area, 12);
  EXPECT_DOUBLE_EQ(parts.components[0].u, 7.0);
  EXPECT_DOUBLE_EQ(parts.components[0].v, 2.5);
  // Of two with five pixels, the upper one comes first.
  EXPECT_EQ(parts.components[1].y, 0);
  EXPECT_EQ(parts.components[2].y, 6);
  for (const Component& part : parts.components) {
    EXPECT_EQ(std::count(parts.labels.begin(), parts.labels.end(), part.label), part.area);
  }
}

TEST(Components, AnEmptyMaskHasNone) {
  const std::vector<std::uint8_t> mask(12, 0);
  EXPECT_TRUE(connected_components(mask.data(), 4, 3).components.empty());
  EXPECT_THROW(connected_components(mask.data(), 0, 3), std::invalid_argument);
}

}  // namespace
}  // namespace gslts::detect
