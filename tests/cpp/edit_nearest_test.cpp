#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "edit_scenes.hpp"
#include "gslts/edit/inherit_attributes.hpp"
#include "gslts/edit/nearest.hpp"
#include "gslts/edit/thin_points.hpp"

namespace gslts::edit {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<float> random_points(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0, 1);
  std::vector<float> points(3 * count);
  for (float& x : points) x = normal(random);
  return points;
}

GaussianMap map_at(const std::vector<float>& points) {
  std::vector<Eigen::Vector3d> centres;
  for (std::size_t i = 0; i < points.size(); i += 3) {
    centres.push_back(Eigen::Map<const Eigen::Vector3f>(&points[i]).cast<double>());
  }
  return map_of(centres);
}

double distance_m(const float* a, const float* b) {
  return (Eigen::Map<const Eigen::Vector3f>(a).cast<double>() -
          Eigen::Map<const Eigen::Vector3f>(b).cast<double>())
      .norm();
}

/// Thins points by exhaustive search.
std::vector<std::uint32_t> thinned(const std::vector<float>& points,
                                   const std::vector<float>& spacing_m) {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < spacing_m.size(); ++i) {
    const bool free = std::all_of(rows.begin(), rows.end(), [&](std::uint32_t j) {
      return distance_m(&points[3 * i], &points[3 * j]) >= double(spacing_m[i]);
    });
    if (free) rows.push_back(i);
  }
  return rows;
}

TEST(Nearest, EqualsExhaustiveSearch) {
  constexpr std::size_t kGaussians = 2000, kPoints = 300;
  const std::vector<float> centres = random_points(kGaussians, 1),
                           points = random_points(kPoints, 2);
  const GaussianMap map = map_at(centres);
  for (const int k : {1, 5}) {
    const Neighbours found = nearest_gaussians(map.view(), points.data(), kPoints, k);
    ASSERT_EQ(found.k, k);
    for (std::size_t q = 0; q < kPoints; ++q) {
      std::vector<double> expected;
      for (std::size_t i = 0; i < kGaussians; ++i) {
        expected.push_back(distance_m(&points[3 * q], &centres[3 * i]));
      }
      std::sort(expected.begin(), expected.end());
      for (std::size_t j = 0; j < std::size_t(k); ++j) {
        const std::size_t row = found.rows[q * std::size_t(k) + j];
        const double distance = double(found.distances_m[q * std::size_t(k) + j]);
        EXPECT_NEAR(distance, expected[j], 1e-6);
        EXPECT_NEAR(distance_m(&points[3 * q], &centres[3 * row]), expected[j], 1e-6);
      }
    }
  }
}

TEST(Nearest, FindsFewerInASmallMap) {
  const GaussianMap map = map_of({{1, 0, 0}, {3, 0, 0}});
  const std::vector<float> point = {2.5f, 0, 0};
  const Neighbours found = nearest_gaussians(map.view(), point.data(), 1, 8);
  EXPECT_EQ(found.k, 2);
  EXPECT_THAT(found.rows, ElementsAre(1, 0));
  EXPECT_THAT(found.distances_m, ElementsAre(0.5f, 1.5f));
  EXPECT_TRUE(nearest_gaussians(map.view(), nullptr, 0, 3).rows.empty());
}

TEST(Nearest, FindsOneOfManyEqualCentres) {
  const GaussianMap map = map_of(std::vector<Eigen::Vector3d>(100, {1, 2, 3}));
  const std::vector<float> point = {1, 2, 3};
  const Neighbours found = nearest_gaussians(map.view(), point.data(), 1, 1);
  EXPECT_LT(found.rows[0], 100u);
  EXPECT_EQ(found.distances_m[0], 0.0f);
}

TEST(ThinPoints, KeepsDistancesAndLeavesNoGap) {
  constexpr std::size_t kPoints = 1500;
  const std::vector<float> points = random_points(kPoints, 3);
  std::vector<float> spacing_m(kPoints);
  for (std::size_t i = 0; i < kPoints; ++i) spacing_m[i] = 0.1f + 0.3f * float(i % 7) / 7;
  const Array<std::uint32_t> stay = thin_points(points.data(), spacing_m.data(), kPoints);
  EXPECT_EQ(std::vector<std::uint32_t>(stay.begin(), stay.end()), thinned(points, spacing_m));
  EXPECT_LT(stay.size(), kPoints * 3 / 4);
}

TEST(ThinPoints, KeepsDistancesOfAllScales) {
  constexpr std::size_t kPoints = 1500;
  std::vector<float> points = random_points(kPoints, 4), spacing_m = random_points(kPoints, 5);
  spacing_m.resize(kPoints);
  for (std::size_t i = 0; i < kPoints; ++i) {
    spacing_m[i] = std::exp(2 * spacing_m[i] - 3);  // 1 mm to 20 m.
    for (std::size_t c = 0; c < 3; ++c) points[3 * i + c] *= i % 2 == 0 ? 1 : 0.01f;
  }
  const Array<std::uint32_t> stay = thin_points(points.data(), spacing_m.data(), kPoints);
  EXPECT_EQ(std::vector<std::uint32_t>(stay.begin(), stay.end()), thinned(points, spacing_m));
}

TEST(ThinPoints, AcceptsExtremes) {
  EXPECT_TRUE(thin_points(nullptr, nullptr, 0).empty());
  const std::vector<float> same(30, 1.0f), tiny(10, 1e-30f);
  EXPECT_THAT(thin_points(same.data(), tiny.data(), 10), ElementsAre(0));
  const std::vector<float> apart = {0, 0, 0, 1e30f, 0, 0, -1e30f, 0, 0};
  EXPECT_THAT(thin_points(apart.data(), tiny.data(), 3), ElementsAre(0, 1, 2));
}

TEST(InheritAttributes, CopiesAllButTheCentres) {
  const GaussianMap map = map_of({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {10, 0, 0});
  const std::vector<float> points = {5, 6, 7, 8, 9, 10};
  const std::vector<std::uint32_t> rows = {2, 2};
  const GaussianMap born = inherit_attributes(map.view(), points.data(), rows.data(), 2, 42);
  EXPECT_EQ(born.origin, map.origin);
  EXPECT_THAT(born.means, ElementsAre(5, 6, 7, 8, 9, 10));
  EXPECT_THAT(born.ids, ElementsAre(42, 43));
  const auto same = [&](const Array<float>& from, const Array<float>& to, std::size_t columns) {
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t k = 0; k < columns; ++k) {
        EXPECT_EQ(to[i * columns + k], from[2 * columns + k]);
      }
    }
  };
  same(map.quats, born.quats, 4);
  same(map.log_scales, born.log_scales, 3);
  same(map.logit_opacities, born.logit_opacities, 1);
  same(map.sh, born.sh, 12);
  same(map.features, born.features, 2);
  EXPECT_EQ(inherit_attributes(map.view(), nullptr, nullptr, 0, 0).size(), 0u);
}

TEST(EditErrors, NameWhatIsWrong) {
  const GaussianMap map = map_of({{0, 0, 0}});
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<float> points = {0, 0, 0, 0, inf, 0}, spacing_m = {1, 0};
  EXPECT_THAT(message_of([&] { nearest_gaussians(map.view(), points.data(), 2, 1); }),
              HasSubstr("nearest_gaussians: points[1] is not finite"));
  EXPECT_THAT(message_of([&] { nearest_gaussians(map.view(), points.data(), 1, 0); }),
              HasSubstr("nearest_gaussians: k must be at least 1, got 0"));
  EXPECT_THAT(message_of([&] { nearest_gaussians(map_of({}).view(), points.data(), 1, 1); }),
              HasSubstr("nearest_gaussians: there is no Gaussian"));
  EXPECT_THAT(message_of([&] { thin_points(points.data(), spacing_m.data(), 2); }),
              HasSubstr("thin_points: points[1] is not finite"));
  const std::vector<float> twice(6, 1.0f);
  EXPECT_THAT(message_of([&] { thin_points(twice.data(), spacing_m.data(), 2); }),
              HasSubstr("thin_points: spacing_m[1] must be positive and finite, got 0"));
  const std::vector<std::uint32_t> rows = {0, 1};
  EXPECT_THAT(message_of([&] { inherit_attributes(map.view(), points.data(), rows.data(), 2, 0); }),
              HasSubstr("inherit_attributes: rows[1] must be below 1, got 1"));
}

}  // namespace
}  // namespace gslts::edit
