#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <random>

#include "color_constancy.hpp"
#include "detect_scenes.hpp"
#include "gslts/detect/regions.hpp"
#include "segmentation.hpp"

namespace gslts::detect {
namespace {

using ::testing::Each;
using testing::ImagePair;
using In = ImagePair::In;

cv::Mat noise(int rows, int columns, int type, unsigned seed) {
  cv::Mat image(rows, columns, type);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.1f, 0.9f);
  std::generate_n(image.ptr<float>(), image.total() * std::size_t(image.channels()),
                  [&] { return uniform(random); });
  return image;
}

// Light.

TEST(MatchLight, RemovesASmoothGainOfEachChannel) {
  const cv::Mat rendered = noise(120, 160, CV_32FC3, 1);
  cv::Mat observed = rendered.clone();
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const float vignetting = 1 - 0.3f * float(x) / 160;
      cv::Vec3f& color = observed.at<cv::Vec3f>(y, x);
      color = {0.9f * vignetting * color[0], vignetting * color[1], 1.2f * vignetting * color[2]};
    }
  }
  const cv::Mat known = cv::Mat::ones(120, 160, CV_8U);
  const cv::Mat before = cv::abs(observed - rendered);
  const cv::Mat after = cv::abs(observed - match_light(rendered, observed, known));
  EXPECT_LT(cv::norm(after, cv::NORM_L1), 0.25 * cv::norm(before, cv::NORM_L1));
}

TEST(MatchLight, LeavesOutWhatChanged) {
  const cv::Mat rendered = noise(120, 160, CV_32FC3, 2);
  cv::Mat observed = 0.8 * rendered;
  observed(cv::Rect(60, 40, 30, 30)).setTo(cv::Scalar(1, 0, 0));
  const cv::Mat known = cv::Mat::ones(120, 160, CV_8U);
  const cv::Mat lit = match_light(rendered, observed, known);
  const cv::Rect changed(60, 40, 30, 30);
  const cv::Scalar gain = cv::mean(lit(changed));
  const cv::Scalar expected = cv::mean(0.8 * rendered(changed));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(gain[c], expected[c], 0.02);
}

TEST(MatchLight, KeepsColorsWhereNothingIsKnown) {
  const cv::Mat rendered = noise(30, 40, CV_32FC3, 3), observed = noise(30, 40, CV_32FC3, 4);
  const cv::Mat lit = match_light(rendered, observed, cv::Mat::zeros(30, 40, CV_8U));
  EXPECT_LT(cv::norm(lit, rendered, cv::NORM_INF), 1e-6);
}

// Segments.

/// Joins pixels as the paper says, with sets and edges sorted by difference; slow.
std::vector<int> segment_slowly(const cv::Mat& image, double scale) {
  const int width = image.cols, size = int(image.total());
  struct Edge {
    double difference;
    int a, b;
  };
  std::vector<Edge> edges;
  const auto* values = image.ptr<cv::Vec4f>();
  for (int k = 0; k < size; ++k) {
    for (const int other : {(k + 1) % width ? k + 1 : size, k + width}) {
      if (other < size) edges.push_back({cv::norm(values[k] - values[other]), k, other});
    }
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& a, const Edge& b) { return a.difference < b.difference; });
  std::vector<int> labels(static_cast<std::size_t>(size));
  std::iota(labels.begin(), labels.end(), 0);
  std::vector<double> internal(static_cast<std::size_t>(size), 0);
  for (const auto& [difference, a, b] : edges) {
    const int i = labels[std::size_t(a)], j = labels[std::size_t(b)];
    if (i == j) continue;
    const auto tolerance = [&](int label) {
      return internal[std::size_t(label)] +
             scale / double(std::count(labels.begin(), labels.end(), label));
    };
    if (difference > std::min(tolerance(i), tolerance(j))) continue;
    std::replace(labels.begin(), labels.end(), j, i);
    internal[std::size_t(i)] = difference;
  }
  return labels;
}

/// Values whose differences are multiples of 1/16, which is the step of the sorting.
cv::Mat blocks(unsigned seed) {
  cv::Mat image(12, 16, CV_32FC4, cv::Scalar::all(0));
  std::mt19937 random(seed);
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 16; ++x) {
      const float step = x / 5 + 2 * (y / 4) > 3 ? 20.0f : 0.0f;
      image.at<cv::Vec4f>(y, x)[0] = step + float(random() % 64) / 4;
    }
  }
  return image;
}

TEST(Segments, AreThoseOfThePaper) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const cv::Mat image = blocks(seed);
    const std::vector<int> expected = segment_slowly(image, 40);
    const auto segments = segment_image(image, {40}, 1).at(0);
    std::vector<int> labels(image.total(), -1);
    for (const Pixels& pixels : segments) {
      for (const std::size_t k : pixels) {
        EXPECT_EQ(labels[k], -1);
        labels[k] = int(pixels.front());
      }
    }
    for (std::size_t a = 0; a < labels.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        EXPECT_EQ(labels[a] == labels[b], expected[a] == expected[b]) << "seed " << seed;
      }
    }
  }
}

TEST(Segments, SmallOnesAreJoined) {
  const auto segments = segment_image(noise(40, 50, CV_32FC4, 5) * 100, {1}, 30).at(0);
  EXPECT_GT(segments.size(), 1u);
  for (const Pixels& pixels : segments) {
    EXPECT_GE(pixels.size(), 30u);
  }
}

// Regions.

Surfaces find_in(const ImagePair& pair, const ObjectRule& rule = {}) {
  const Views views = pair.views();
  return find_changed_regions(views, compute_masks(views, {}), rule);
}

ImagePair red_object(In where) {
  ImagePair pair;
  pair.put(where, 60, 40, 24, 30, ImagePair::kWall_m, 0.8f, 0.1f, 0.1f);
  return pair;
}

TEST(Regions, EqualImagesHaveNone) {
  const Surfaces found = find_in({});
  EXPECT_TRUE(found.surfaces.empty());
  EXPECT_THAT(found.labels, Each(0));
}

TEST(Regions, AnObjectIsFoundByItsColorsAlone) {
  for (const In where : {In::kFrame, In::kMap}) {
    const Surfaces found = find_in(red_object(where));
    ASSERT_FALSE(found.surfaces.empty());
    const Surface& surface = found.surfaces[0];
    EXPECT_EQ(surface.side, where == In::kFrame ? Side::kAfter : Side::kBefore);
    EXPECT_NEAR(surface.area_px, 24 * 30, 120);
    EXPECT_EQ(confidence(surface), *surface.color_confidence);
    EXPECT_GT(confidence(surface), 0.5);
    EXPECT_EQ(std::count(found.labels.begin(), found.labels.end(), 1), surface.area_px);
    const std::vector<ObjectChange> changes = classify_changes(found.surfaces, {});
    EXPECT_EQ(changes.size(), 1u);
  }
}

TEST(Regions, TwoObjectsSideBySideStayApart) {
  ImagePair pair = red_object(In::kFrame);
  pair.put(In::kFrame, 84, 40, 24, 30, ImagePair::kWall_m, 0.1f, 0.1f, 0.8f);
  EXPECT_EQ(classify_changes(find_in(pair).surfaces, {}).size(), 2u);
}

ImagePair object_of_two_colors(float depth_m) {
  ImagePair pair;
  pair.put(In::kFrame, 60, 40, 24, 15, depth_m, 0.8f, 0.1f, 0.1f);
  pair.put(In::kFrame, 60, 55, 24, 15, depth_m, 0.1f, 0.1f, 0.8f);
  return pair;
}

TEST(Regions, AnObjectOfTwoColorsIsOneByItsDepth) {
  EXPECT_EQ(classify_changes(find_in(object_of_two_colors(ImagePair::kWall_m)).surfaces, {}).size(),
            2u);
  const Surfaces found = find_in(object_of_two_colors(ImagePair::kWall_m - 0.1f));
  const std::vector<ObjectChange> changes = classify_changes(found.surfaces, {});
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].type, ChangeType::kAddition);
  EXPECT_NEAR(changes[0].after->area_px, 24 * 30, 120);
}

TEST(Regions, WhatIsNearerThanTheOtherImageIsMoreLikely) {
  for (const In where : {In::kFrame, In::kMap}) {
    double previous = 0;
    for (const float step_m : {-0.04f, 0.0f, 0.02f, 0.04f}) {
      ImagePair pair;
      pair.put(where, 60, 40, 24, 30, ImagePair::kWall_m - step_m, 0.6f, 0.5f, 0.45f);
      const Views views = pair.views();
      double highest = 0;
      for (const Region& region : find_regions(views, compute_masks(views, {}), {})) {
        const bool own = region.side == (where == In::kFrame ? Side::kAfter : Side::kBefore);
        if (own) highest = std::max(highest, region_confidence(region.features));
      }
      EXPECT_GT(highest, previous);
      previous = highest;
    }
  }
}

TEST(Regions, DarkerLightIsNoChange) {
  ImagePair pair;
  for (float& color : pair.observed_rgb) color *= 0.6f;
  EXPECT_TRUE(find_in(pair).surfaces.empty());
}

TEST(Regions, WhereTheMapIsUnknownNothingIsFound) {
  ImagePair pair = red_object(In::kFrame);
  std::fill(pair.alpha.begin(), pair.alpha.end(), 0.0f);
  EXPECT_TRUE(find_in(pair).surfaces.empty());
}

TEST(Regions, ObjectsWithoutDepthGetThatOfTheMap) {
  ImagePair pair = red_object(In::kFrame);
  std::fill(pair.observed_depth.begin(), pair.observed_depth.end(),
            std::numeric_limits<float>::quiet_NaN());
  const Surfaces found = find_in(pair);
  ASSERT_FALSE(found.surfaces.empty());
  EXPECT_NEAR(found.surfaces[0].depth_m, ImagePair::kWall_m, 1e-6);
}

TEST(Regions, InvalidSettingsAreRejected) {
  ObjectRule rule;
  rule.min_area_px = -1;
  EXPECT_THROW(find_in({}, rule), std::invalid_argument);
}

}  // namespace
}  // namespace gslts::detect
