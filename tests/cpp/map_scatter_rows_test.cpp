#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <stdexcept>
#include <vector>

#include "gslts/map/scatter_rows.hpp"

namespace gslts {
namespace {

using ::testing::HasSubstr;

template <typename T>
class ScatterRows : public ::testing::Test {};
using Numbers = ::testing::Types<float, double, std::uint32_t>;
TYPED_TEST_SUITE(ScatterRows, Numbers);

TYPED_TEST(ScatterRows, PutsRowsInTheirPlacesAndZerosElsewhere) {
  const std::vector<std::uint32_t> rows = {0, 2, 3, 6};
  for (std::size_t columns : {1u, 2u, 3u, 4u, 48u}) {
    std::vector<TypeParam> values;
    for (std::size_t i = 0; i < rows.size() * columns; ++i) values.push_back(TypeParam(i + 1));
    const auto out = scatter_rows(rows.data(), values.data(), rows.size(), columns, 8);
    std::vector<TypeParam> expected(8 * columns, TypeParam(0));
    for (std::size_t i = 0; i < values.size(); ++i) {
      expected[rows[i / columns] * columns + i % columns] = values[i];
    }
    EXPECT_EQ(std::vector<TypeParam>(out.begin(), out.end()), expected) << columns;
  }
}

TYPED_TEST(ScatterRows, NoRowsAreAllZeros) {
  const auto out = scatter_rows<TypeParam>(nullptr, nullptr, 0, 3, 2);
  EXPECT_EQ(std::vector<TypeParam>(out.begin(), out.end()), std::vector<TypeParam>(6));
  EXPECT_TRUE(scatter_rows<TypeParam>(nullptr, nullptr, 0, 3, 0).empty());
}

TEST(ScatterRowsErrors, BadRowsAreNamed) {
  const float values[2] = {1, 2};
  const auto error = [&](std::vector<std::uint32_t> rows) -> std::string {
    try {
      scatter_rows(rows.data(), values, rows.size(), 1, 5);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(error({3, 4}), "");
  EXPECT_THAT(error({0, 5}), HasSubstr("stay below 5, got 5 at 1"));
  EXPECT_THAT(error({2, 2}), HasSubstr("must ascend"));
  EXPECT_THAT(error({2, 1}), HasSubstr("got 1 at 1"));
}

}  // namespace
}  // namespace gslts
