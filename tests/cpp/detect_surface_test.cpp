#include <gmock/gmock.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "color_histogram.hpp"
#include "detect_scenes.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::detect {
namespace {

using testing::ImagePair;
using In = ImagePair::In;

constexpr double kFocal_px = 160;

std::vector<Surface> surfaces_in(const ImagePair& pair) {
  const Views views = pair.views();
  return find_changed_surfaces(views, compute_masks(views, {}), {}).surfaces;
}

Surface only_surface_in(const ImagePair& pair) {
  const std::vector<Surface> surfaces = surfaces_in(pair);
  EXPECT_EQ(surfaces.size(), 1u);
  return surfaces.at(0);
}

/// A box in front of the wall.
Surface box(In where, float red, float green, float blue, int width = 20, int height = 10) {
  ImagePair pair;
  pair.put(where, 60, 40, width, height, 1.6f, red, green, blue);
  return only_surface_in(pair);
}

TEST(Evidence, ThicknessIsTheSmallestExtent) {
  ImagePair pair;
  pair.put(In::kFrame, 60, 20, 6, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  const Surface surface = only_surface_in(pair);
  EXPECT_NEAR(surface.depth_m, 1.6, 1e-6);
  EXPECT_NEAR(surface.evidence.thickness_m, 6 * 1.6 / kFocal_px, 0.015);
}

TEST(Evidence, LightExplainsAChangeOfBrightness) {
  ImagePair pair;
  for (std::size_t k = 0; k < pair.observed_rgb.size(); ++k) {
    pair.rendered_rgb[k] = pair.observed_rgb[k] = 0.3f + 0.1f * float(k / 3 % 7) / 7;  // A texture.
  }
  pair.put(In::kFrame, 60, 40, 30, 20, ImagePair::kWall_m, 0, 0, 0);
  for (int row = 40; row < 60; ++row) {
    for (int column = 60; column < 90; ++column) {
      const std::size_t k = 3 * (std::size_t(row) * ImagePair::kWidth + std::size_t(column));
      for (std::size_t c = k; c < k + 3; ++c) pair.observed_rgb[c] = 1.6f * pair.rendered_rgb[c];
    }
  }
  const Surface lit = only_surface_in(pair);
  EXPECT_LT(lit.evidence.residual_color, 0.05);
  pair.put(In::kFrame, 60, 40, 30, 20, ImagePair::kWall_m, 0.6f, 0.6f, 0.2f);
  const Surface painted = only_surface_in(pair);
  EXPECT_GT(painted.evidence.residual_color, 0.2);
  EXPECT_LT(confidence(lit), confidence(painted));
}

TEST(Evidence, BrightnessOfOneSurfaceCorrelates) {
  ImagePair pair;
  for (std::size_t k = 0; k < pair.observed_rgb.size(); ++k) {
    pair.rendered_rgb[k] = pair.observed_rgb[k] = k / 3 % 9 < 4 ? 0.2f : 0.6f;
  }
  ImagePair same = pair, other = pair;
  for (int row = 40; row < 60; ++row) {
    for (int column = 60; column < 90; ++column) {
      same.observed_depth[std::size_t(row) * ImagePair::kWidth + std::size_t(column)] = 1.6f;
    }
  }
  other.put(In::kFrame, 60, 40, 30, 20, 1.6f, 0.4f, 0.4f, 0.4f);
  EXPECT_NEAR(only_surface_in(same).evidence.correlation, 1, 1e-6);
  EXPECT_LT(only_surface_in(other).evidence.correlation, 0.8);
}

TEST(Evidence, StripOfALargerObjectIsAttached) {
  ImagePair pair;  // The map shows a box 6 px wider than it is.
  pair.put(In::kFrame, 60, 30, 30, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 60, 30, 36, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  const Surface strip = only_surface_in(pair);
  EXPECT_EQ(strip.side, Side::kBefore);
  EXPECT_NEAR(strip.evidence.attached_share, 0.45, 0.1);
  const Surface whole = box(In::kMap, 0.8f, 0.2f, 0.2f, 36, 60);
  EXPECT_EQ(whole.evidence.attached_share, 0);
  EXPECT_LT(confidence(strip), confidence(whole));
}

TEST(Evidence, RingMeasuresErrorsOfTheMap) {
  ImagePair pair;
  pair.put(In::kFrame, 60, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_NEAR(only_surface_in(pair).evidence.ring_depth_m, 0, 1e-6);
  EXPECT_NEAR(only_surface_in(pair).evidence.ring_color_ratio, 0, 1e-6);
  for (float& depth : pair.rendered_depth) depth += 0.02f;
  for (float& color : pair.rendered_rgb) color += 0.05f;
  EXPECT_NEAR(only_surface_in(pair).evidence.ring_depth_m, 0.02, 1e-6);
  // 0.15 of a difference of 0.25 + 0.35 + 0.35 and what is added to it.
  EXPECT_NEAR(only_surface_in(pair).evidence.ring_color_ratio, 0.15 / (0.95 + 0.05), 0.01);
}

TEST(Confidence, AdditionInSeenFreeSpaceIsMoreLikely) {
  Surface surface = box(In::kFrame, 0.6f, 0.4f, 0.4f);
  surface.visibility = Visibility{0, 1000, 1};
  const double free = confidence(surface);
  surface.visibility = Visibility{1000, 0, 1};
  const double solid = confidence(surface);
  surface.visibility = Visibility{0, 0, 0};
  const double unseen = confidence(surface);
  EXPECT_GT(free, 0.9);
  EXPECT_LT(solid, free);
  EXPECT_LT(unseen, 0.5);
}

TEST(Confidence, RemovalOfASeenSurfaceIsMoreLikely) {
  Surface surface = box(In::kMap, 0.6f, 0.4f, 0.4f);
  surface.visibility = Visibility{1000, 10, 1};
  const double solid = confidence(surface);
  surface.visibility = Visibility{100, 900, 1};
  EXPECT_LT(confidence(surface), solid);
}

TEST(Confidence, StaysAProbabilityAtExtremes) {
  Surface surface;
  for (const double area_m2 : {0.0, 1e-12, 1e6}) {
    for (const double steps : {0.0, 1e-9, 1e9}) {
      surface.area_m2 = area_m2;
      surface.evidence.step_ratio = steps;
      EXPECT_GE(confidence(surface), 0);
      EXPECT_LE(confidence(surface), 1);
    }
  }
}

TEST(MatchScore, ComparesColoursAndSizes) {
  const Surface red = box(In::kMap, 0.8f, 0.2f, 0.2f);
  const Surface again = box(In::kFrame, 0.8f, 0.2f, 0.2f);
  const Surface darker = box(In::kFrame, 0.7f, 0.15f, 0.15f);
  const Surface blue = box(In::kFrame, 0.2f, 0.2f, 0.8f);
  const Surface huge = box(In::kFrame, 0.8f, 0.2f, 0.2f, 95, 78);
  EXPECT_GT(match_score(red, again), 0.95);
  EXPECT_GT(match_score(red, darker), match_score(red, blue));
  EXPECT_LT(match_score(red, blue), 0.05);
  EXPECT_EQ(match_score(red, huge), 0);
  EXPECT_DOUBLE_EQ(match_score(red, darker), match_score(darker, red));
}

TEST(MatchScore, ObjectsDoNotGrow) {
  const Surface low = box(In::kMap, 0.8f, 0.2f, 0.2f);
  Surface tall = box(In::kFrame, 0.8f, 0.2f, 0.2f);
  const double same = match_score(low, tall);
  tall.high.z() += 2 * (tall.high - tall.low).z() + 0.1;
  EXPECT_LT(match_score(low, tall), same);
  EXPECT_EQ(match_score(tall, low), same);  // The sensor may miss a part of it.
}

TEST(MatchScore, HistogramsSumUpToOne) {
  for (const float red : {0.0f, 0.3f, 1.0f}) {
    const Surface surface = box(In::kFrame, red, 0.9f, 0.1f);
    double sum = 0;
    for (const float share : surface.color_histogram) {
      EXPECT_GE(share, 0);
      sum += double(share);
    }
    EXPECT_NEAR(sum, 1, 1e-5);
  }
}

TEST(Surface, OneBuiltByHandIsClassified) {
  Surface surface;
  surface.side = Side::kAfter;
  surface.point = {1, 2, 3};
  surface.low = {0.9, 1.9, 2.9};
  surface.high = {1.1, 2.1, 3.1};
  validate(surface, "test");
  ObjectRule rule;
  rule.min_confidence = 0;
  const std::vector<ObjectChange> changes = classify_changes({surface}, rule);
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].type, ChangeType::kAddition);
  EXPECT_EQ(changes[0].confidence, confidence(surface));
  surface.color_confidence = 0.7;
  EXPECT_EQ(classify_changes({surface}, rule)[0].confidence, 0.7);
  EXPECT_EQ(match_features(surface, surface)[0], 1);  // Without histograms nothing matches.
}

std::string message_of(const Surface& surface) {
  try {
    classify_changes({surface}, {});
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Surface, InvalidFieldsAreNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Surface inverted, unsure, unmeasured, unseen, colorless;
  inverted.low = {1, 0, 0};
  EXPECT_EQ(message_of(inverted), "classify_changes: low must not exceed high, got 1");
  unsure.color_confidence = nan;
  EXPECT_EQ(message_of(unsure), "classify_changes: color_confidence must be in [0, 1], got nan");
  unmeasured.evidence.thickness_m = -1;
  EXPECT_EQ(message_of(unmeasured),
            "classify_changes: thickness_m must be finite and at least 0, got -1");
  unseen.visibility = Visibility{0, nan, 1};
  EXPECT_EQ(message_of(unseen),
            "classify_changes: seen_through must be finite and at least 0, got nan");
  colorless.color_histogram.assign(kHistogramBins, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(message_of(colorless),
            "classify_changes: color_histogram must not be negative or NaN, got nan");
}

TEST(Parts, CloseSurfacesAreOneObject) {
  for (const int gap_px : {4, 40}) {
    ImagePair pair;  // 4 px are 4 cm, 40 px 40 cm.
    pair.put(In::kFrame, 40, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    pair.put(In::kFrame, 60 + gap_px, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    EXPECT_EQ(surfaces_in(pair).size(), gap_px == 4 ? 1u : 2u);
  }
}

TEST(Parts, SurfacesOfBothSidesAreNoParts) {
  ImagePair pair;
  pair.put(In::kFrame, 40, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 64, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_EQ(surfaces_in(pair).size(), 2u);
}

TEST(Parts, SmallObjectsSideBySideStayTwo) {
  ImagePair pair;  // Of 5 cm, 6 cm apart.
  pair.put(In::kFrame, 40, 40, 5, 7, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kFrame, 53, 40, 5, 7, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_EQ(surfaces_in(pair).size(), 2u);
}

}  // namespace
}  // namespace gslts::detect
