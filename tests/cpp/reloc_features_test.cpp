#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/reloc/features.hpp"
#include "gslts/reloc/landmark_index.hpp"
#include "reloc_scenes.hpp"

// What FLANN draws from; only the library itself is built with the headers of OpenCV.
namespace cv {
class RNG;
RNG& theRNG();
void setRNGSeed(int seed);
}  // namespace cv

namespace gslts::reloc {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

/// A grey image.
struct Picture {
  int width, height;
  std::vector<std::uint8_t> grey;

  Picture(int columns, int rows, int level = 0)
      : width(columns), height(rows), grey(std::size_t(columns * rows), std::uint8_t(level)) {}
  std::uint8_t& at(int column, int row) { return grey[std::size_t(row * width + column)]; }
  std::uint8_t at(int column, int row) const { return grey[std::size_t(row * width + column)]; }
};

/// Resamples an image: pixel (u, v) of the result is pixel (column(u), row(v)) of `from`.
template <typename Column, typename Row>
Picture moved(const Picture& from, int width, int height, Column column, Row row) {
  Picture to(width, height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) to.at(u, v) = from.at(column(u), row(v));
  }
  return to;
}

void fill(Picture& picture, int x0, int y0, int x1, int y1, int level) {
  for (int row = std::max(y0, 0); row < std::min(y1, picture.height); ++row) {
    for (int column = std::max(x0, 0); column < std::min(x1, picture.width); ++column) {
      picture.at(column, row) = std::uint8_t(level);
    }
  }
}

/// As from a camera: of equal pixels, none is the corner.
void add_noise(Picture& picture, std::mt19937& random) {
  for (std::uint8_t& grey : picture.grey) {
    grey = std::uint8_t(std::clamp(int(grey) + int(random() % 7) - 3, 0, 255));
  }
}

/// Rectangles of all sizes, one over another.
Picture rectangles(int width, int height, int count, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](int limit) { return int(random() % unsigned(limit)); };
  Picture picture(width, height, 128);
  for (int k = 0; k < count; ++k) {
    const int x = below(width), y = below(height);
    fill(picture, x - below(20), y - below(20), x + below(20), y + below(20), below(256));
  }
  add_noise(picture, random);
  return picture;
}

constexpr int kAll = 1000000;

FeatureRule rule_of(int count, int levels, double scale_step = 1.2) {
  FeatureRule rule;
  rule.count = count;
  rule.levels = levels;
  rule.scale_step = scale_step;
  return rule;
}

Features features_in(const Picture& picture, const FeatureRule& rule = {}) {
  return features_of(picture.grey.data(), picture.width, picture.height, nullptr, rule);
}

Eigen::Vector2f pixel(const Features& features, std::size_t k) {
  return {features.pixels[2 * k], features.pixels[2 * k + 1]};
}

/// The one that is nearest to a pixel, and how far away, px.
std::pair<std::size_t, float> nearest(const Features& features, const Eigen::Vector2f& to) {
  std::pair<std::size_t, float> best(0, std::numeric_limits<float>::max());
  for (std::size_t k = 0; k < features.size(); ++k) {
    const float distance = (pixel(features, k) - to).norm();
    if (distance < best.second) best = {k, distance};
  }
  return best;
}

TEST(Features, AreAtTheCornersOfARectangle) {
  Picture picture(200, 150, 40);
  fill(picture, 60, 50, 110, 90, 200);
  const std::vector<Eigen::Vector2f> expected = {
      {60.5f, 50.5f}, {109.5f, 50.5f}, {60.5f, 89.5f}, {109.5f, 89.5f}};
  // Of pixels that differ as much from those around, FAST takes none.
  for (const Eigen::Vector2f& corner : expected) picture.at(int(corner.x()), int(corner.y())) = 255;
  const Features features = features_in(picture, rule_of(100, 1));
  ASSERT_EQ(features.size(), 4u);
  for (const Eigen::Vector2f& corner : expected) EXPECT_EQ(nearest(features, corner).second, 0.0f);
}

TEST(Features, OfAMirroredPictureAreMirrored) {
  const Picture picture = rectangles(301, 227, 400, 1);
  const auto same = [](int k) { return k; };
  const Picture across = moved(
      picture, 301, 227, [](int u) { return 300 - u; }, same);
  const Picture down = moved(picture, 301, 227, same, [](int v) { return 226 - v; });
  const FeatureRule rule = rule_of(kAll, 6);
  const Features features = features_in(picture, rule);
  ASSERT_GT(features.size(), 500u);
  for (const bool is_across : {true, false}) {
    const Features mirrored = features_in(is_across ? across : down, rule);
    std::size_t found = 0;
    for (std::size_t k = 0; k < features.size(); ++k) {
      Eigen::Vector2f expected = pixel(features, k);
      (is_across ? expected.x() : expected.y()) *= -1;
      (is_across ? expected.x() : expected.y()) += is_across ? 301.0f : 227.0f;
      found += nearest(mirrored, expected).second < 0.01f;
    }
    EXPECT_GT(double(found), 0.95 * double(features.size()));
  }
}

TEST(Features, OfACoarserLevelAreThoseOfASmallerPicture) {
  const Picture small = rectangles(160, 120, 150, 2);
  const auto half = [](int k) { return k / 2; };
  const Picture large = moved(small, 320, 240, half, half);
  const Features fine = features_in(large, rule_of(kAll, 1)),
                 both = features_in(large, rule_of(kAll, 2, 2.0)),
                 of_small = features_in(small, rule_of(kAll, 1));
  ASSERT_GT(of_small.size(), 50u);
  ASSERT_EQ(both.size(), fine.size() + of_small.size());
  for (std::size_t k = 0; k < of_small.size(); ++k) {
    EXPECT_EQ(pixel(both, fine.size() + k), 2 * pixel(of_small, k));
  }
  EXPECT_TRUE(std::equal(of_small.descriptors.begin(), of_small.descriptors.end(),
                         both.descriptors.begin() + std::ptrdiff_t(fine.descriptors.size())));
}

TEST(Features, TurnWithThePicture) {
  const Picture picture = rectangles(240, 240, 250, 3);
  Picture quarter(240, 240);
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 240; ++u) quarter.at(239 - v, u) = picture.at(u, v);
  }
  const FeatureRule rule = rule_of(kAll, 1);
  const Features features = features_in(picture, rule), turned = features_in(quarter, rule);
  std::vector<int> bits;
  for (std::size_t k = 0; k < features.size(); ++k) {
    const Eigen::Vector2f at = pixel(features, k), expected(240 - at.y(), at.x());
    const auto [other, distance] = nearest(turned, expected);
    ASSERT_LT(distance, 0.01f);
    bits.push_back(bits_between(&features.descriptors[32 * k], &turned.descriptors[32 * other]));
  }
  ASSERT_GT(bits.size(), 100u);
  std::sort(bits.begin(), bits.end());
  EXPECT_LE(bits[bits.size() / 2], 25);
  EXPECT_LE(bits[bits.size() * 9 / 10], 50);
}

TEST(Features, AreSpreadOverThePicture) {
  // The left half is full of strong corners, the right half of weak ones.
  Picture picture = rectangles(400, 300, 2000, 4);
  for (int row = 0; row < 300; ++row) {
    for (int column = 200; column < 400; ++column) {
      picture.at(column, row) = std::uint8_t(100 + picture.at(column, row) / 6);
    }
  }
  const auto right_share = [&](const Features& features) {
    int right = 0;
    for (std::size_t k = 0; k < features.size(); ++k) right += pixel(features, k).x() > 200;
    return right / double(features.size());
  };
  const Features few = features_in(picture, rule_of(300, 4));
  EXPECT_EQ(few.size(), 300u);
  EXPECT_GT(right_share(few), 0.35);
}

TEST(Features, AreAsManyAsWanted) {
  const Picture picture = rectangles(320, 240, 800, 5);
  for (const int count : {1, 2, 7, 100, 500}) {
    const Features features = features_in(picture, rule_of(count, 8));
    EXPECT_EQ(features.size(), std::size_t(count));
    EXPECT_EQ(features.descriptors.size(), kDescriptorBytes * std::size_t(count));
  }
  EXPECT_EQ(features_in(Picture(320, 240, 77)).size(), 0u);
}

TEST(Features, AreWhereTheMaskWantsThem) {
  const Picture picture = rectangles(300, 200, 500, 6);
  std::vector<std::uint8_t> mask(picture.grey.size(), 0);
  const auto masked = [&] {
    return features_of(picture.grey.data(), 300, 200, mask.data(), rule_of(kAll, 8));
  };
  EXPECT_EQ(masked().size(), 0u);
  for (std::size_t k = 0; k < mask.size(); ++k) mask[k] = k % 300 >= 100 && k % 300 < 180;
  const Features features = masked();
  EXPECT_GT(features.size(), 50u);
  for (std::size_t k = 0; k < features.size(); ++k) {
    EXPECT_GE(pixel(features, k).x(), 100);
    EXPECT_LT(pixel(features, k).x(), 180);
  }
  std::fill(mask.begin(), mask.end(), std::uint8_t(1));
  EXPECT_EQ(masked().pixels, features_in(picture, rule_of(kAll, 8)).pixels);
}

TEST(Features, OfSmallPicturesAreNone) {
  const std::vector<std::array<int, 2>> sizes = {{1, 1}, {38, 38}, {20, 500}, {500, 1}};
  for (const auto& [width, height] : sizes) {
    EXPECT_EQ(features_in(rectangles(width, height, 300, 7)).size(), 0u);
  }
  Picture least(39, 39, 0);
  least.at(19, 19) = 255;
  const Features features = features_in(least);
  ASSERT_EQ(features.size(), 1u);
  EXPECT_EQ(pixel(features, 0), Eigen::Vector2f(19.5f, 19.5f));
}

TEST(Features, AreTheSameEveryTime) {
  const Picture picture = rectangles(320, 240, 800, 8);
  const Features first = features_in(picture), second = features_in(picture);
  EXPECT_EQ(first.pixels, second.pixels);
  EXPECT_EQ(first.descriptors, second.descriptors);
}

TEST(FeatureErrors, NameWhatIsWrong) {
  const std::uint8_t grey = 0;
  const auto message = [&](int width, auto change) {
    FeatureRule rule;
    change(rule);
    return message_of([&] { features_of(&grey, width, 1, nullptr, rule); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(0, [](FeatureRule&) {}),
              HasSubstr("features_of: width must be in 1..65536, got 0"));
  EXPECT_THAT(message(1, [](FeatureRule& rule) { rule.count = 0; }),
              HasSubstr("features_of: rule.count must be positive, got 0"));
  EXPECT_THAT(message(1, [](FeatureRule& rule) { rule.scale_step = 1; }),
              HasSubstr("rule.scale_step must be above 1 and finite, got 1"));
  EXPECT_THAT(message(1, [&](FeatureRule& rule) { rule.scale_step = nan; }),
              HasSubstr("rule.scale_step"));
  EXPECT_THAT(message(1, [](FeatureRule& rule) { rule.levels = 17; }),
              HasSubstr("rule.levels must be in 1..16, got 17"));
  EXPECT_THAT(message(1, [](FeatureRule& rule) { rule.fast_threshold = 255; }),
              HasSubstr("rule.fast_threshold must be in 1..254, got 255"));
}

TEST(LandmarkIndex, FindsMostOfExhaustiveSearch) {
  constexpr std::size_t kLandmarks = 5000, kFeatures = 300;
  std::mt19937 random(9);
  Landmarks landmarks;
  for (std::size_t i = 0; i < kLandmarks; ++i) landmarks.add({0, 0, 0}, 0, random);
  const LandmarkIndex index(landmarks.view());
  for (const auto& [flips, least_recall] : {std::pair(0, 1.0), {20, 0.97}, {40, 0.75}}) {
    Features features;
    for (std::size_t i = 0; i < kFeatures; ++i) {
      add(features, {1, 1}, flipped(landmarks.descriptor(i), flips, random));
    }
    const Matches matches = index.match(features, 3);
    ASSERT_EQ(matches.landmarks.size(), 3 * kFeatures);
    int found = 0;
    for (std::size_t i = 0; i < kFeatures; ++i) {
      // Random descriptors differ in more bits than these.
      found += matches.landmarks[3 * i] == int(i) && matches.distances[3 * i] == flips;
      for (std::size_t k = 3 * i; k < 3 * i + 3; ++k) {
        const int row = matches.landmarks[k];
        EXPECT_EQ(matches.distances[k],
                  row < 0 ? 256
                          : bits_between(&features.descriptors[32 * i],
                                         &landmarks.descriptors[32 * std::size_t(row)]));
        EXPECT_LE(matches.distances[k == 3 * i ? k : k - 1], matches.distances[k]);
      }
    }
    EXPECT_GE(found, least_recall * double(kFeatures));
  }
}

TEST(LandmarkIndex, IsTheSameWhateverIsDrawnBeforeAndDrawsNothing) {
  std::mt19937 random(10);
  Landmarks landmarks;
  Features features;
  for (std::size_t i = 0; i < 3000; ++i) landmarks.add({0, 0, 0}, 0, random);
  for (std::size_t i = 0; i < 300; ++i) {
    add(features, {1, 1}, flipped(landmarks.descriptor(i), 60, random));
  }
  // Half of these are missed: other keys would miss others.
  const Matches first = LandmarkIndex(landmarks.view()).match(features, 4);
  EXPECT_GT(std::count(first.landmarks.begin(), first.landmarks.end(), -1), 0);
  // All that a generator holds.
  const auto state = [] { return reinterpret_cast<const std::uint64_t&>(cv::theRNG()); };
  for (int k = 1; k < 4; ++k) {
    cv::setRNGSeed(1000 * k);
    const std::uint64_t before = state();
    const Matches again = LandmarkIndex(landmarks.view()).match(features, 4);
    EXPECT_EQ(again.landmarks, first.landmarks);
    EXPECT_EQ(again.distances, first.distances);
    EXPECT_EQ(state(), before);
    EXPECT_EQ(before, std::uint64_t(1000 * k));
  }
}

TEST(LandmarkIndex, KeepsACopy) {
  std::mt19937 random(11);
  Landmarks landmarks;
  for (int i = 0; i < 10; ++i) landmarks.add({float(i), 1, 2}, i, random);
  Features features;
  add(features, {1, 1}, landmarks.descriptor(7));
  const auto emptied = [&] {
    LandmarkIndex index(landmarks.view());
    std::fill(landmarks.descriptors.begin(), landmarks.descriptors.end(), std::uint8_t(0));
    std::fill(landmarks.positions.begin(), landmarks.positions.end(), 0.0f);
    return index;
  };
  const LandmarkIndex index = emptied();
  EXPECT_EQ(index.match(features, 1).landmarks[0], 7);
  EXPECT_EQ(index.landmarks().size, 10u);
  EXPECT_EQ(index.landmarks().positions[21], 7.0f);
  EXPECT_EQ(index.landmarks().keyframes[7], 7);
}

TEST(LandmarkIndex, TakesExtremes) {
  std::mt19937 random(12);
  Landmarks landmarks;
  Features features;
  EXPECT_TRUE(LandmarkIndex(landmarks.view()).match(features, 1).landmarks.empty());
  add(features, {1, 1}, Descriptor{});
  const Matches none = LandmarkIndex(landmarks.view()).match(features, 2);
  EXPECT_THAT(none.landmarks, Each(-1));
  EXPECT_THAT(none.distances, Each(256));
  for (int i = 0; i < 1000; ++i) landmarks.add({0, 0, 0}, 0, Descriptor{});
  const Matches same = LandmarkIndex(landmarks.view()).match(features, 16);
  EXPECT_THAT(same.distances, Each(0));
}

TEST(LandmarkIndex, GivesAllLandmarksIfThereAreFewerThanWanted) {
  std::mt19937 random(14);
  Landmarks landmarks;
  Features features;
  for (int i = 0; i < 3; ++i) landmarks.add({0, 0, 0}, 0, Descriptor{});
  for (int i = 0; i < 2; ++i) add(features, {1, 1}, flipped(Descriptor{}, 2 * i, random));
  const Matches matches = LandmarkIndex(landmarks.view()).match(features, 5);
  ASSERT_EQ(matches.landmarks.size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(matches.landmarks[i] >= 0, i % 5 < 3) << i;
    EXPECT_EQ(matches.distances[i], i % 5 < 3 ? 2 * int(i / 5) : 256) << i;
  }
}

TEST(LandmarkIndexErrors, NameWhatIsWrong) {
  std::mt19937 random(13);
  Landmarks landmarks;
  for (int i = 0; i < 3; ++i) landmarks.add({1, 2, 3}, 0, random);
  const LandmarkIndex index(landmarks.view());
  Features features;
  EXPECT_THAT(message_of([&] { index.match(features, 0); }),
              HasSubstr("LandmarkIndex.match: k must be in 1..16, got 0"));
  EXPECT_THAT(message_of([&] { index.match(features, 17); }), HasSubstr("got 17"));
  features.pixels = {1, 1};
  EXPECT_THAT(message_of([&] { index.match(features, 1); }),
              HasSubstr("LandmarkIndex.match: expected 32 bytes of descriptors, got 0"));
  landmarks.keyframes[2] = -1;
  EXPECT_THAT(message_of([&] { LandmarkIndex{landmarks.view()}; }),
              HasSubstr("LandmarkIndex: keyframes[2] must not be negative, got -1"));
  landmarks.positions[4] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(message_of([&] { LandmarkIndex{landmarks.view()}; }),
              HasSubstr("LandmarkIndex: positions[1] is not finite"));
}

}  // namespace
}  // namespace gslts::reloc
