#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/plan/distance_field.hpp"

namespace gslts::plan {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A map drawn with # for walls and G for goals.
Array<double> field_of(const std::vector<std::string>& drawing, double cell_m = 1) {
  std::vector<std::uint8_t> free, goals;
  for (const std::string& row : drawing) {
    for (const char cell : row) {
      free.push_back(cell != '#');
      goals.push_back(cell == 'G');
    }
  }
  return distance_field(free.data(), goals.data(), int(drawing.size()), int(drawing[0].size()),
                        cell_m);
}

TEST(DistanceField, AlongACorridorIsExact) {
  EXPECT_THAT(field_of({"..G...#."}, 0.5),
              testing::Pointwise(testing::DoubleNear(1e-12),
                                 {1.0, 0.5, 0.0, 0.5, 1.0, 1.5, kInfinity, kInfinity}));
}

TEST(DistanceField, PathsDoNotPassBetweenTwoWallsThatTouch) {
  const Array<double> field = field_of({"G#", "#."});
  EXPECT_EQ(field[0], 0);
  EXPECT_EQ(field[3], kInfinity);
}

TEST(DistanceField, OnAFreeFloorApproachesTheStraightLine) {
  constexpr int kSize = 101, kMiddle = 50;
  const std::vector<std::uint8_t> free(kSize * kSize, 1);
  std::vector<std::uint8_t> goals(kSize * kSize, 0);
  goals[kMiddle * kSize + kMiddle] = 1;
  const Array<double> field = distance_field(free.data(), goals.data(), kSize, kSize, 0.05);
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      const double straight = 0.05 * std::hypot(row - kMiddle, column - kMiddle);
      EXPECT_NEAR(field[std::size_t(row * kSize + column)], straight, 0.6 * 0.05 + 0.01 * straight);
    }
  }
}

TEST(DistanceField, GoalsInWallsAreIgnored) {
  const std::vector<std::uint8_t> free = {0, 1}, goals = {1, 0};
  EXPECT_THAT(distance_field(free.data(), goals.data(), 1, 2, 1),
              testing::Each(testing::Eq(kInfinity)));
}

TEST(DistanceField, AnEmptyGridHasAnEmptyField) {
  EXPECT_TRUE(distance_field(nullptr, nullptr, 0, 0, 1).empty());
}

TEST(DistanceField, ABadCellIsNamed) {
  try {
    field_of({"G"}, 0);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "distance_field: cell_m must be positive and finite, got 0");
  }
}

}  // namespace
}  // namespace gslts::plan
