#include <gmock/gmock.h>

#include "detect_scenes.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::detect {
namespace {

using testing::Pair;
using In = Pair::In;

constexpr double kFocal_px = 160;

std::vector<Surface> surfaces_in(const Pair& pair) {
  const Views views = pair.views();
  return changed_surfaces(views, masks_of(views, {}), {}).surfaces;
}

Surface only_surface_in(const Pair& pair) {
  const std::vector<Surface> surfaces = surfaces_in(pair);
  EXPECT_EQ(surfaces.size(), 1u);
  return surfaces.at(0);
}

/// A box in front of the wall.
Surface box(In where, float red, float green, float blue, int width = 20, int height = 10) {
  Pair pair;
  pair.put(where, 60, 40, width, height, 1.6f, red, green, blue);
  return only_surface_in(pair);
}

TEST(Evidence, ThicknessIsThatOfTheThinnestExtent) {
  Pair pair;
  pair.put(In::kPhoto, 60, 20, 6, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  const Surface surface = only_surface_in(pair);
  EXPECT_NEAR(surface.depth_m, 1.6, 1e-6);
  EXPECT_NEAR(surface.evidence.thickness_m, 6 * 1.6 / kFocal_px, 0.015);
}

TEST(Evidence, LightAloneExplainsADifferenceInBrightness) {
  Pair pair;
  for (std::size_t k = 0; k < pair.photo.size(); ++k) {
    pair.rgb[k] = pair.photo[k] = 0.3f + 0.1f * float(k / 3 % 7) / 7;  // A texture.
  }
  pair.put(In::kPhoto, 60, 40, 30, 20, Pair::kWall_m, 0, 0, 0);
  for (int row = 40; row < 60; ++row) {
    for (int column = 60; column < 90; ++column) {
      const std::size_t k = 3 * (std::size_t(row) * Pair::kWidth + std::size_t(column));
      for (std::size_t c = k; c < k + 3; ++c) pair.photo[c] = 1.6f * pair.rgb[c];
    }
  }
  const Surface lit = only_surface_in(pair);
  EXPECT_LT(lit.evidence.unexplained, 0.05);
  pair.put(In::kPhoto, 60, 40, 30, 20, Pair::kWall_m, 0.6f, 0.6f, 0.2f);
  const Surface painted = only_surface_in(pair);
  EXPECT_GT(painted.evidence.unexplained, 0.2);
  EXPECT_LT(certainty(lit), certainty(painted));
}

TEST(Evidence, BrightnessesOfOneSurfaceCorrelate) {
  Pair pair;
  for (std::size_t k = 0; k < pair.photo.size(); ++k) {
    pair.rgb[k] = pair.photo[k] = k / 3 % 9 < 4 ? 0.2f : 0.6f;
  }
  Pair same = pair, other = pair;
  for (int row = 40; row < 60; ++row) {
    for (int column = 60; column < 90; ++column) {
      same.measured[std::size_t(row) * Pair::kWidth + std::size_t(column)] = 1.6f;
    }
  }
  other.put(In::kPhoto, 60, 40, 30, 20, 1.6f, 0.4f, 0.4f, 0.4f);
  EXPECT_NEAR(only_surface_in(same).evidence.correlation, 1, 1e-6);
  EXPECT_LT(only_surface_in(other).evidence.correlation, 0.8);
}

TEST(Evidence, AStripOfABodyIsAttachedToIt) {
  Pair pair;  // The map has 6 px more of a box than there are.
  pair.put(In::kPhoto, 60, 30, 30, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 60, 30, 36, 60, 1.6f, 0.8f, 0.2f, 0.2f);
  const Surface strip = only_surface_in(pair);
  EXPECT_EQ(strip.side, Side::kBefore);
  EXPECT_NEAR(strip.evidence.attached, 0.45, 0.1);
  const Surface whole = box(In::kMap, 0.8f, 0.2f, 0.2f, 36, 60);
  EXPECT_EQ(whole.evidence.attached, 0);
  EXPECT_LT(certainty(strip), certainty(whole));
}

TEST(Evidence, WhatIsAroundTellsOfErrors) {
  Pair pair;
  pair.put(In::kPhoto, 60, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_NEAR(only_surface_in(pair).evidence.around_m, 0, 1e-6);
  EXPECT_NEAR(only_surface_in(pair).evidence.around_color, 0, 1e-6);
  for (float& depth : pair.rendered) depth += 0.02f;
  for (float& color : pair.rgb) color += 0.05f;
  EXPECT_NEAR(only_surface_in(pair).evidence.around_m, 0.02, 1e-6);
  // 0.15 of a difference of 0.25 + 0.35 + 0.35 and what is added to it.
  EXPECT_NEAR(only_surface_in(pair).evidence.around_color, 0.15 / (0.95 + 0.05), 0.01);
}

TEST(Certainty, WhatAppearsWasLookedThroughBefore) {
  Surface surface = box(In::kPhoto, 0.6f, 0.4f, 0.4f);
  surface.sights = Sights{0, 1000, 1};
  const double free = certainty(surface);
  surface.sights = Sights{1000, 0, 1};
  const double solid = certainty(surface);
  surface.sights = Sights{0, 0, 0};
  const double unseen = certainty(surface);
  EXPECT_GT(free, 0.9);
  EXPECT_LT(solid, free);
  EXPECT_LT(unseen, 0.5);
}

TEST(Certainty, WhatVanishesWasASurfaceBefore) {
  Surface surface = box(In::kMap, 0.6f, 0.4f, 0.4f);
  surface.sights = Sights{1000, 10, 1};
  const double solid = certainty(surface);
  surface.sights = Sights{100, 900, 1};
  EXPECT_LT(certainty(surface), solid);
}

TEST(Certainty, ItIsAProbabilityAtTheExtremes) {
  Surface surface;
  for (const double area_m2 : {0.0, 1e-12, 1e6}) {
    for (const double steps : {0.0, 1e-9, 1e9}) {
      surface.area_m2 = area_m2;
      surface.evidence.steps = steps;
      EXPECT_GE(certainty(surface), 0);
      EXPECT_LE(certainty(surface), 1);
    }
  }
}

TEST(Likeness, ColoursAndSizesTellObjectsApart) {
  const Surface red = box(In::kMap, 0.8f, 0.2f, 0.2f);
  const Surface again = box(In::kPhoto, 0.8f, 0.2f, 0.2f);
  const Surface darker = box(In::kPhoto, 0.7f, 0.15f, 0.15f);
  const Surface blue = box(In::kPhoto, 0.2f, 0.2f, 0.8f);
  const Surface larger = box(In::kPhoto, 0.8f, 0.2f, 0.2f, 40, 20);
  const Surface huge = box(In::kPhoto, 0.8f, 0.2f, 0.2f, 95, 78);
  EXPECT_GT(likeness(red, again), 0.95);
  EXPECT_GT(likeness(red, darker), likeness(red, blue));
  EXPECT_LT(likeness(red, blue), 0.05);
  EXPECT_GT(likeness(red, again), likeness(red, larger));
  EXPECT_EQ(likeness(red, huge), 0);
  EXPECT_DOUBLE_EQ(likeness(red, larger), likeness(larger, red));
}

TEST(Likeness, HistogramsSumUpToOne) {
  for (const float red : {0.0f, 0.3f, 1.0f}) {
    const Surface surface = box(In::kPhoto, red, 0.9f, 0.1f);
    double sum = 0;
    for (const float share : surface.colors) {
      EXPECT_GE(share, 0);
      sum += double(share);
    }
    EXPECT_NEAR(sum, 1, 1e-5);
  }
}

TEST(Parts, WhatIsCloseTogetherIsOneObject) {
  for (const int gap_px : {4, 40}) {
    Pair pair;  // 4 px are 4 cm, 40 px 40 cm.
    pair.put(In::kPhoto, 40, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    pair.put(In::kPhoto, 60 + gap_px, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
    EXPECT_EQ(surfaces_in(pair).size(), gap_px == 4 ? 1u : 2u);
  }
}

TEST(Parts, WhatAppearsAndWhatVanishesAreNoParts) {
  Pair pair;
  pair.put(In::kPhoto, 40, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kMap, 64, 40, 20, 10, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_EQ(surfaces_in(pair).size(), 2u);
}

TEST(Parts, SmallThingsSideBySideStayTwo) {
  Pair pair;  // Of 5 cm, 6 cm apart.
  pair.put(In::kPhoto, 40, 40, 5, 7, 1.6f, 0.8f, 0.2f, 0.2f);
  pair.put(In::kPhoto, 53, 40, 5, 7, 1.6f, 0.8f, 0.2f, 0.2f);
  EXPECT_EQ(surfaces_in(pair).size(), 2u);
}

}  // namespace
}  // namespace gslts::detect
