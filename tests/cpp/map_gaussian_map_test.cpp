#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/map/gaussian_map.hpp"

namespace gslts {
namespace {

using ::testing::HasSubstr;

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

/// A map in which every number is `value`.
template <typename T>
BasicGaussianMap<T> constant_map(std::size_t size, int sh_bases, int feature_dims, T value = T(1)) {
  BasicGaussianMap<T> map = make_gaussian_map<T>(size, sh_bases, feature_dims);
  for (Array<T>* array :
       {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh, &map.features}) {
    std::fill(array->begin(), array->end(), value);
  }
  return map;
}

template <typename T>
class GaussianMapTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(GaussianMapTest, Scalars);

TYPED_TEST(GaussianMapTest, HasTheShapesAskedFor) {
  for (int bases : {1, 4, 9, 16}) {
    const auto map = make_gaussian_map<TypeParam>(7, bases, 5, 100);
    EXPECT_EQ(map.size(), 7u);
    EXPECT_EQ(map.sh_bases, bases);
    EXPECT_EQ(map.feature_dims, 5);
    EXPECT_EQ(map.means.size(), 21u);
    EXPECT_EQ(map.quats.size(), 28u);
    EXPECT_EQ(map.log_scales.size(), 21u);
    EXPECT_EQ(map.logit_opacities.size(), 7u);
    EXPECT_EQ(map.sh.size(), std::size_t(21 * bases));
    EXPECT_EQ(map.features.size(), 35u);
    EXPECT_THAT(map.ids, testing::ElementsAre(100, 101, 102, 103, 104, 105, 106));
    EXPECT_EQ(map.origin, Eigen::Vector3d::Zero());
  }
}

TYPED_TEST(GaussianMapTest, MayBeEmpty) {
  const auto map = make_gaussian_map<TypeParam>(0, 4, 3);
  EXPECT_EQ(map.size(), 0u);
  EXPECT_TRUE(map.ids.empty());
  EXPECT_NO_THROW(validate(map.view(), "test"));
  EXPECT_NO_THROW(require_finite(map.view(), "test"));
}

TYPED_TEST(GaussianMapTest, RejectsBadShapes) {
  EXPECT_EQ(error_of([] { make_gaussian_map<TypeParam>(3, 5); }),
            "make_gaussian_map: sh_bases must be 1, 4, 9 or 16, got 5");
  EXPECT_THAT(error_of([] { make_gaussian_map<TypeParam>(3, 0); }), HasSubstr("sh_bases"));
  EXPECT_EQ(error_of([] { make_gaussian_map<TypeParam>(3, 1, -2); }),
            "make_gaussian_map: feature_dims must not be negative, got -2");
}

TYPED_TEST(GaussianMapTest, ViewPointsAtTheArrays) {
  auto map = constant_map<TypeParam>(3, 4, 2);
  map.origin = {1e6, -2e6, 5};
  const GaussianView<TypeParam> view = map.view();
  EXPECT_EQ(view.size, 3u);
  EXPECT_EQ(view.sh_bases, 4);
  EXPECT_EQ(view.feature_dims, 2);
  EXPECT_EQ(view.means, map.means.data());
  EXPECT_EQ(view.quats, map.quats.data());
  EXPECT_EQ(view.log_scales, map.log_scales.data());
  EXPECT_EQ(view.logit_opacities, map.logit_opacities.data());
  EXPECT_EQ(view.sh, map.sh.data());
  EXPECT_EQ(view.features, map.features.data());
  EXPECT_EQ(view.origin, map.origin);
  EXPECT_EQ(constant_map<TypeParam>(3, 4, 0).view().features, nullptr);
}

TYPED_TEST(GaussianMapTest, ViewRejectsArraysOfTheWrongLength) {
  const auto error_after = [](auto change) {
    auto map = constant_map<TypeParam>(3, 4, 2);
    change(map);
    return error_of([&] { map.view(); });
  };
  EXPECT_EQ(error_after([](auto& map) { map.means.pop_back(); }),
            "BasicGaussianMap::view: means must hold 3 x 3 numbers, got 8");
  EXPECT_THAT(error_after([](auto& map) { map.quats.pop_back(); }), HasSubstr("quats"));
  EXPECT_THAT(error_after([](auto& map) { map.log_scales.resize(10); }), HasSubstr("log_scales"));
  EXPECT_THAT(error_after([](auto& map) { map.sh.resize(9); }), HasSubstr("sh must hold 3 x 12"));
  EXPECT_THAT(error_after([](auto& map) { map.features.clear(); }), HasSubstr("features"));
  EXPECT_THAT(error_after([](auto& map) { map.sh_bases = 2; }), HasSubstr("sh_bases"));
}

TYPED_TEST(GaussianMapTest, ValidateNamesCallerFieldAndValue) {
  const auto map = constant_map<TypeParam>(3, 4, 2);
  const auto error_after = [&](auto change) {
    GaussianView<TypeParam> view = map.view();
    change(view);
    return error_of([&] { validate(view, "Caller::method"); });
  };
  EXPECT_EQ(error_after([](auto&) {}), "nothing was thrown");
  EXPECT_EQ(error_after([](auto& view) { view.sh_bases = 3; }),
            "Caller::method: sh_bases must be 1, 4, 9 or 16, got 3");
  EXPECT_EQ(error_after([](auto& view) { view.feature_dims = -1; }),
            "Caller::method: feature_dims must not be negative, got -1");
  EXPECT_EQ(error_after([](auto& view) { view.means = nullptr; }),
            "Caller::method: means must point to [N,3] numbers, got null");
  EXPECT_THAT(error_after([](auto& view) { view.quats = nullptr; }), HasSubstr("quats"));
  EXPECT_THAT(error_after([](auto& view) { view.log_scales = nullptr; }), HasSubstr("log_scales"));
  EXPECT_THAT(error_after([](auto& view) { view.logit_opacities = nullptr; }),
              HasSubstr("logit_opacities"));
  EXPECT_THAT(error_after([](auto& view) { view.sh = nullptr; }), HasSubstr("sh must"));
  EXPECT_THAT(error_after([](auto& view) { view.features = nullptr; }), HasSubstr("features"));
  EXPECT_THAT(
      error_after([](auto& view) { view.origin(1) = std::numeric_limits<double>::quiet_NaN(); }),
      HasSubstr("Caller::method: origin"));
}

TYPED_TEST(GaussianMapTest, ValidateLeavesValuesToTheKernels) {
  const auto map = constant_map<TypeParam>(3, 4, 2, std::numeric_limits<TypeParam>::quiet_NaN());
  EXPECT_NO_THROW(validate(map.view(), "test"));
}

TYPED_TEST(GaussianMapTest, RequireFiniteAcceptsAnyFiniteNumber) {
  using Limits = std::numeric_limits<TypeParam>;
  for (TypeParam value : {Limits::max(), Limits::lowest(), Limits::denorm_min(), TypeParam(-0.0)}) {
    EXPECT_NO_THROW(require_finite(constant_map<TypeParam>(500, 9, 3, value).view(), "test"));
  }
}

TYPED_TEST(GaussianMapTest, RequireFiniteNamesArrayIndexAndValue) {
  using Limits = std::numeric_limits<TypeParam>;
  const auto error_after = [](auto change) {
    auto map = constant_map<TypeParam>(20, 4, 3);
    change(map);
    return error_of([&] { require_finite(map.view(), "Caller::method"); });
  };
  const TypeParam nan = Limits::quiet_NaN(), inf = Limits::infinity();
  EXPECT_EQ(error_after([&](auto& map) { map.means[3 * 19 + 2] = nan; }),
            "Caller::method: means[19,2] is nan");
  EXPECT_EQ(error_after([&](auto& map) { map.quats[4 * 5 + 3] = -nan; }),
            "Caller::method: quats[5,3] is nan");
  EXPECT_EQ(error_after([&](auto& map) { map.log_scales[3 * 12 + 1] = inf; }),
            "Caller::method: log_scales[12,1] is inf");
  EXPECT_EQ(error_after([&](auto& map) { map.logit_opacities[0] = -inf; }),
            "Caller::method: logit_opacities[0] is -inf");
  EXPECT_EQ(error_after([&](auto& map) { map.sh[12 * 7 + 3 * 2 + 1] = nan; }),
            "Caller::method: sh[7,2,1] is nan");
  EXPECT_EQ(error_after([&](auto& map) { map.features[3 * 18] = nan; }),
            "Caller::method: features[18,0] is nan");
}

TYPED_TEST(GaussianMapTest, RequireFiniteGivesEveryIndexOfAThinArray) {
  auto map = constant_map<TypeParam>(20, 1, 1);
  map.features[7] = std::numeric_limits<TypeParam>::quiet_NaN();
  EXPECT_EQ(error_of([&] { require_finite(map.view(), "f"); }), "f: features[7,0] is nan");
  map.sh[3 * 4] = std::numeric_limits<TypeParam>::quiet_NaN();
  EXPECT_EQ(error_of([&] { require_finite(map.view(), "f"); }), "f: sh[4,0,0] is nan");
}

TYPED_TEST(GaussianMapTest, RequireFiniteReportsTheFirst) {
  const TypeParam nan = std::numeric_limits<TypeParam>::quiet_NaN();
  auto map = constant_map<TypeParam>(20, 4, 3);
  map.features[0] = nan;
  map.log_scales[3 * 9] = nan;
  map.log_scales[3 * 4 + 1] = nan;
  EXPECT_EQ(error_of([&] { require_finite(map.view(), "f"); }), "f: log_scales[4,1] is nan");
}

/// The vectorised check works in chunks: a bad number must be seen at every offset of several.
TYPED_TEST(GaussianMapTest, RequireFiniteFindsABadNumberAnywhere) {
  auto map = constant_map<TypeParam>(4100, 1, 0);
  for (std::size_t i = 0; i < map.logit_opacities.size(); ++i) {
    const TypeParam good = map.logit_opacities[i];
    map.logit_opacities[i] = std::numeric_limits<TypeParam>::infinity();
    ASSERT_EQ(error_of([&] { require_finite(map.view(), "f"); }),
              "f: logit_opacities[" + std::to_string(i) + "] is inf");
    map.logit_opacities[i] = good;
  }
}

TYPED_TEST(GaussianMapTest, SelectTakesWholeGaussians) {
  auto map = make_gaussian_map<TypeParam>(5, 4, 2, 70);
  TypeParam next = 0;
  for (Array<TypeParam>* array :
       {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh, &map.features}) {
    for (TypeParam& value : *array) value = ++next;
  }
  map.origin = {1, 2, 3};
  const auto selected = select(map, {3, 1});
  EXPECT_THAT(selected.ids, testing::ElementsAre(73, 71));
  EXPECT_EQ(selected.origin, map.origin);
  const auto row_of = [](const Array<TypeParam>& array, std::size_t row, std::size_t columns) {
    return std::vector<TypeParam>(array.begin() + row * columns,
                                  array.begin() + (row + 1) * columns);
  };
  for (std::size_t row : {0u, 1u}) {
    const std::size_t from = row == 0 ? 3 : 1;
    EXPECT_EQ(row_of(selected.means, row, 3), row_of(map.means, from, 3));
    EXPECT_EQ(row_of(selected.quats, row, 4), row_of(map.quats, from, 4));
    EXPECT_EQ(row_of(selected.log_scales, row, 3), row_of(map.log_scales, from, 3));
    EXPECT_EQ(row_of(selected.logit_opacities, row, 1), row_of(map.logit_opacities, from, 1));
    EXPECT_EQ(row_of(selected.sh, row, 12), row_of(map.sh, from, 12));
    EXPECT_EQ(row_of(selected.features, row, 2), row_of(map.features, from, 2));
  }
  EXPECT_EQ(select(map, {}).size(), 0u);
  EXPECT_EQ(error_of([&] { select(map, {0, 5}); }), "select: rows[1] is 5, must be below 5");
  map.ids.pop_back();
  EXPECT_THAT(error_of([&] { select(map, {0}); }), HasSubstr("ids must hold 5 x 1"));
}

}  // namespace
}  // namespace gslts
