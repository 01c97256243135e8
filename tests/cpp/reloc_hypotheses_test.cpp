#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "gslts/reloc/hypotheses.hpp"
#include "reloc_scenes.hpp"

namespace gslts::reloc {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const Eigen::Isometry3d kTruth = look_at({0.3, -0.2, 1.4}, {3.0, 0.4, 1.1});
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

Camera camera_at(const Eigen::Isometry3d& world_from_camera) {
  return camera_from_fov(640, 480, 1.2, world_from_camera);
}

/// Landmarks in front of the camera at kTruth, as keyframes see them, ten in turn.
Landmarks room(std::size_t count, std::mt19937& random) {
  std::uniform_real_distribution<float> anywhere(-2, 2);
  Landmarks landmarks;
  for (std::size_t i = 0; i < count; ++i) {
    landmarks.add({3 + anywhere(random), anywhere(random), 1 + 0.6f * anywhere(random)},
                  int(i % 10), random);
  }
  return landmarks;
}

/// Errors of the observations of landmarks by a camera.
struct Sight {
  double outliers = 0;     ///< Share of landmarks observed at a wrong position.
  double noise_px = 0.5;   ///< Standard deviation of the position, px.
  double noise_depth = 0;  ///< Relative standard deviation of the depth.
  int flips = 20;          ///< Number of bits of a descriptor that differ.
  bool depth = true;
};

struct Seen {
  Features features;
  std::vector<float> depths;
  int inliers = 0;
};

Seen seen_of(const Landmarks& landmarks, const Sight& sight, std::mt19937& random) {
  const Camera camera = camera_at(kTruth);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  Seen seen;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const Eigen::Vector3d x = kTruth.inverse() * landmarks.position(i).cast<double>();
    Eigen::Vector2d pixel(camera.fx * x.x() / x.z() + camera.cx,
                          camera.fy * x.y() / x.z() + camera.cy);
    const bool inside = (pixel.array() > 0).all() && pixel.x() < 640 && pixel.y() < 480;
    if (x.z() < 0.3 || !inside) continue;
    const bool outlier = uniform(random) < sight.outliers;
    if (outlier) pixel = {640 * uniform(random), 480 * uniform(random)};
    pixel += sight.noise_px * Eigen::Vector2d(normal(random), normal(random));
    add(seen.features, pixel.cast<float>(), flipped(landmarks.descriptor(i), sight.flips, random));
    const double depth = x.z() * (1 + sight.noise_depth * normal(random));
    seen.depths.push_back(sight.depth ? float(depth) : 0.0f);
    seen.inliers += !outlier;
  }
  return seen;
}

std::vector<Hypothesis> found(const Landmarks& landmarks, const Seen& seen,
                              const HypothesisRule& rule = {}) {
  return hypotheses_of(camera_at(Eigen::Isometry3d::Identity()), seen.features, seen.depths.data(),
                       LandmarkIndex(landmarks.view()), rule);
}

double off_m(const Hypothesis& hypothesis, const Eigen::Isometry3d& truth = kTruth) {
  return (hypothesis.world_from_camera.translation() - truth.translation()).norm();
}

double off_rad(const Hypothesis& hypothesis, const Eigen::Isometry3d& truth = kTruth) {
  return Eigen::AngleAxisd(hypothesis.world_from_camera.linear().transpose() * truth.linear())
      .angle();
}

class FromSights : public ::testing::TestWithParam<Sight> {};

TEST_P(FromSights, ThePoseIsFound) {
  std::mt19937 random(1);
  const Landmarks landmarks = room(1500, random);
  const Seen seen = seen_of(landmarks, GetParam(), random);
  ASSERT_GT(seen.features.size(), 400u);
  const std::vector<Hypothesis> hypotheses = found(landmarks, seen);
  ASSERT_THAT(hypotheses, SizeIs(1));
  EXPECT_LT(off_m(hypotheses[0]), 0.01);
  EXPECT_LT(off_rad(hypotheses[0]), 0.003);
  // Some are missed among the nearest landmarks, some noise is above the margins.
  EXPECT_GT(hypotheses[0].inliers, 0.9 * seen.inliers);
  EXPECT_LT(hypotheses[0].inliers, 1.02 * seen.inliers + 5);
}

INSTANTIATE_TEST_SUITE_P(Hypotheses, FromSights,
                         ::testing::Values(Sight{}, Sight{0.5, 0.5, 0.01, 20, true},
                                           Sight{0.8, 0.5, 0.01, 20, true},
                                           Sight{0, 0.5, 0, 20, false},
                                           Sight{0.5, 0.5, 0, 20, false},
                                           Sight{0.3, 0, 0.02, 30, true}));

TEST(Hypotheses, AreExactWithoutNoise) {
  std::mt19937 random(2);
  const Landmarks landmarks = room(500, random);
  for (const bool depth : {true, false}) {
    const Seen seen = seen_of(landmarks, {0.3, 0, 0, 0, depth}, random);
    const std::vector<Hypothesis> hypotheses = found(landmarks, seen);
    ASSERT_THAT(hypotheses, SizeIs(1));
    EXPECT_LT(off_m(hypotheses[0]), 1e-5);
    EXPECT_LT(off_rad(hypotheses[0]), 1e-5);
  }
}

TEST(Hypotheses, AreTwoInTwoRoomsThatLookAlike) {
  std::mt19937 random(3);
  const Eigen::Vector3f apart(0, 12, 0);
  Landmarks landmarks = room(600, random);
  const Seen seen = seen_of(landmarks, {0.2, 0.5, 0.01, 15, true}, random);
  for (std::size_t i = 0; i < 600; ++i) {
    landmarks.add(landmarks.position(i) + apart, 10 + landmarks.keyframes[i],
                  landmarks.descriptor(i));
  }
  Eigen::Isometry3d other = kTruth;
  other.pretranslate(apart.cast<double>());
  for (const bool depth : {true, false}) {
    Seen view = seen;
    if (!depth) std::fill(view.depths.begin(), view.depths.end(), 0.0f);
    const std::vector<Hypothesis> hypotheses = found(landmarks, view);
    ASSERT_THAT(hypotheses, SizeIs(2));
    const bool here_first = off_m(hypotheses[0]) < off_m(hypotheses[1]);
    const Hypothesis &here = hypotheses[here_first ? 0 : 1],
                     &there = hypotheses[here_first ? 1 : 0];
    EXPECT_LT(off_m(here), 0.01);
    EXPECT_LT(off_m(there, other), 0.01);
    EXPECT_LT(off_rad(there, other), 0.003);
    EXPECT_NEAR(here.inliers, there.inliers, 0.05 * here.inliers);
    EXPECT_LT(here.keyframe, 10);
    EXPECT_GE(there.keyframe, 10);
  }
}

TEST(Hypotheses, DoNotTryAPlaceTwice) {
  std::mt19937 random(12);
  const Landmarks corners = room(600, random);
  const Seen seen = seen_of(corners, {}, random);
  Landmarks landmarks;
  for (const int keyframe : {0, 1, 2, 3}) {  // Two in each of two rooms.
    const Eigen::Vector3f apart(0, keyframe < 2 ? 0 : 12, 0);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      landmarks.add(corners.position(i) + apart, keyframe, corners.descriptor(i));
    }
  }
  HypothesisRule rule;
  rule.keyframes = 2;
  EXPECT_THAT(found(landmarks, seen, rule), SizeIs(2));
}

TEST(Hypotheses, AreFewerWhereFewerKeyframesAreTried) {
  std::mt19937 random(4);
  Landmarks landmarks = room(600, random);
  const Seen seen = seen_of(landmarks, {}, random);
  for (std::size_t i = 0; i < 600; ++i) {
    landmarks.add(landmarks.position(i) + Eigen::Vector3f(0, 12, 0), 10, landmarks.descriptor(i));
  }
  HypothesisRule rule;
  rule.keyframes = 0;  // Descriptors that are alike everywhere say nothing.
  EXPECT_THAT(found(landmarks, seen, rule), IsEmpty());
  rule.keyframes = 1;
  EXPECT_THAT(found(landmarks, seen, rule), SizeIs(1));
}

TEST(Hypotheses, NeedDepthThatAgrees) {
  std::mt19937 random(5);
  const Landmarks landmarks = room(600, random);
  Seen seen = seen_of(landmarks, {}, random);
  for (std::size_t k = 0; k < seen.depths.size(); k += 3) seen.depths[k] *= 1.065f;
  const std::vector<Hypothesis> hypotheses = found(landmarks, seen);
  ASSERT_THAT(hypotheses, SizeIs(1));
  EXPECT_LT(off_m(hypotheses[0]), 0.01);
  EXPECT_LT(hypotheses[0].inliers, 0.68 * seen.inliers);
}

TEST(Hypotheses, TakeNaNForNoDepth) {
  std::mt19937 random(6);
  const Landmarks landmarks = room(600, random);
  Seen seen = seen_of(landmarks, {}, random);
  for (std::size_t k = 0; k < seen.depths.size(); k += 2) seen.depths[k] = 0;
  const std::vector<Hypothesis> zero = found(landmarks, seen);
  for (float& depth : seen.depths) {
    if (depth == 0) depth = kNaN;
  }
  const std::vector<Hypothesis> nan = found(landmarks, seen);
  ASSERT_THAT(zero, SizeIs(1));
  ASSERT_THAT(nan, SizeIs(1));
  EXPECT_EQ(zero[0].world_from_camera.matrix(), nan[0].world_from_camera.matrix());
}

TEST(Hypotheses, CountACornerOnce) {
  std::mt19937 random(7);
  Landmarks corners = room(60, random);
  Seen seen = seen_of(corners, {0, 0, 0, 0, true}, random);
  ASSERT_GE(seen.features.size(), 5u);
  // Five corners, each found at eight levels.
  Seen levels;
  for (std::size_t k = 0; k < 40; ++k) {
    const float* pixel = &seen.features.pixels[2 * (k % 5)];
    Descriptor descriptor;
    std::copy_n(&seen.features.descriptors[32 * (k % 5)], 32, descriptor.begin());
    add(levels.features, {pixel[0] + 0.05f * float(k / 5), pixel[1]}, descriptor);
    levels.depths.push_back(seen.depths[k % 5]);
  }
  EXPECT_THAT(found(corners, levels), IsEmpty());
  HypothesisRule rule;
  rule.min_inliers = 4;
  const std::vector<Hypothesis> hypotheses = found(corners, levels, rule);
  ASSERT_THAT(hypotheses, SizeIs(1));
  EXPECT_EQ(hypotheses[0].inliers, 5);
}

TEST(Hypotheses, AreNoneWhereNothingFits) {
  std::mt19937 random(8);
  const Landmarks landmarks = room(600, random);
  EXPECT_THAT(found(landmarks, {}), IsEmpty());
  const Seen seen = seen_of(landmarks, {}, random);
  EXPECT_THAT(found({}, seen), IsEmpty());
  EXPECT_THAT(found(room(600, random), seen), IsEmpty());
  for (const bool depth : {true, false}) {
    EXPECT_THAT(found(landmarks, seen_of(landmarks, {1.0, 0.5, 0, 20, depth}, random)), IsEmpty());
  }
  HypothesisRule rule;
  rule.min_inliers = seen.inliers + 1;
  EXPECT_THAT(found(landmarks, seen, rule), IsEmpty());
}

TEST(Hypotheses, TakeDegenerateInput) {
  std::mt19937 random(9);
  const Landmarks landmarks = room(300, random);
  const Seen seen = seen_of(landmarks, {0, 0, 0, 0, true}, random);
  for (const bool depth : {true, false}) {
    Landmarks one_place = landmarks, line = landmarks, far = landmarks;
    for (std::size_t i = 0; i < landmarks.positions.size(); ++i) {
      one_place.positions[i] = 1.5f;
      line.positions[i] = float(i / 3) * 0.01f;
      far.positions[i] *= 1e18f;
    }
    Seen view = seen, one_pixel = seen;
    std::fill(one_pixel.features.pixels.begin(), one_pixel.features.pixels.end(), 100.0f);
    if (!depth) {
      std::fill(view.depths.begin(), view.depths.end(), 0.0f);
      one_pixel.depths = view.depths;
    }
    EXPECT_THAT(found(one_place, view), IsEmpty());
    for (const Landmarks& map : {one_place, line, far, landmarks}) {
      for (const Hypothesis& one : found(map, one_pixel)) {
        EXPECT_TRUE(one.world_from_camera.matrix().allFinite());
      }
      EXPECT_NO_THROW(found(map, view));
    }
  }
}

TEST(Hypotheses, AreTheSameEveryTime) {
  std::mt19937 random(10);
  const Landmarks landmarks = room(1000, random);
  for (const bool depth : {true, false}) {
    const Seen seen = seen_of(landmarks, {0.6, 0.5, 0.01, 30, depth}, random);
    const std::vector<Hypothesis> first = found(landmarks, seen), second = found(landmarks, seen);
    ASSERT_FALSE(first.empty());
    ASSERT_EQ(first.size(), second.size());
    for (std::size_t k = 0; k < first.size(); ++k) {
      EXPECT_EQ(first[k].world_from_camera.matrix(), second[k].world_from_camera.matrix());
      EXPECT_EQ(first[k].inliers, second[k].inliers);
      EXPECT_EQ(first[k].keyframe, second[k].keyframe);
    }
  }
}

TEST(HypothesisErrors, NameWhatIsWrong) {
  std::mt19937 random(11);
  const Landmarks landmarks = room(20, random);
  const auto message = [&](auto change) {
    HypothesisRule rule;
    change(rule);
    return message_of([&] { found(landmarks, {}, rule); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.neighbours = 17; }),
              HasSubstr("hypotheses_of: rule.neighbours must be in 1..16, got 17"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.max_bits = 257; }),
              HasSubstr("rule.max_bits must be in 0..256, got 257"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.ratio = 0; }),
              HasSubstr("rule.ratio must be in (0, 1], got 0"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.same_landmark_m = -1; }),
              HasSubstr("rule.same_landmark_m must not be negative, and finite, got -1"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.keyframes = -1; }),
              HasSubstr("rule.keyframes must not be negative, got -1"));
  EXPECT_THAT(message([&](HypothesisRule& rule) { rule.inlier_px = nan; }),
              HasSubstr("rule.inlier_px must be positive and finite, got nan"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.inlier_depth = 0; }),
              HasSubstr("rule.inlier_depth must be positive and finite, got 0"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.min_inliers = 3; }),
              HasSubstr("rule.min_inliers must be at least 4, got 3"));
  EXPECT_THAT(message([](HypothesisRule& rule) { rule.iterations = 0; }),
              HasSubstr("rule.iterations must be positive, got 0"));
  Seen seen;
  add(seen.features, {1, kNaN}, Descriptor{});
  seen.depths = {1};
  EXPECT_THAT(message_of([&] { found(landmarks, seen); }),
              HasSubstr("hypotheses_of: features.pixels must be finite, got nan"));
  Camera camera = camera_at(kTruth);
  camera.fx = -1;
  EXPECT_THAT(
      message_of([&] { hypotheses_of(camera, {}, nullptr, LandmarkIndex(landmarks.view())); }),
      HasSubstr("hypotheses_of: camera.fx must be positive"));
}

}  // namespace
}  // namespace gslts::reloc
