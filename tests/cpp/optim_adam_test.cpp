// Adam against its definition, one parameter at a time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "gslts/optim/adam.hpp"
#include "raster_scenes.hpp"

namespace gslts::optim {
namespace {

using raster::testing::Random;
using ::testing::HasSubstr;

constexpr int kBases = 4, kDims = 2;
const AdamRates kRates = {0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07};

template <typename T>
BasicGaussianMap<T> random_map(std::size_t size) {
  auto map = make_gaussian_map<T>(size, kBases, kDims);
  Random random(3);
  for (Array<T>* array :
       {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh, &map.features}) {
    for (T& value : *array) value = T(float(random.normal()));
  }
  return map;
}

template <typename T>
raster::Gradients<T> random_gradients(const std::vector<std::uint32_t>& rows, std::uint32_t seed) {
  raster::Gradients<T> gradients;
  gradients.sh_bases = kBases;
  gradients.feature_dims = kDims;
  gradients.rows.assign(rows.begin(), rows.end());
  gradients.dL_dmeans.resize(3 * rows.size());
  gradients.dL_dquats.resize(4 * rows.size());
  gradients.dL_dlog_scales.resize(3 * rows.size());
  gradients.dL_dlogit_opacities.resize(rows.size());
  gradients.dL_dsh.resize(3 * kBases * rows.size());
  gradients.dL_dfeatures.resize(kDims * rows.size());
  Random random(seed);
  for (Array<T>* array :
       {&gradients.dL_dmeans, &gradients.dL_dquats, &gradients.dL_dlog_scales,
        &gradients.dL_dlogit_opacities, &gradients.dL_dsh, &gradients.dL_dfeatures}) {
    for (T& value : *array) value = T(float(random.normal() * std::exp(4 * random.normal())));
  }
  return gradients;
}

std::vector<std::uint32_t> all_rows(std::size_t size) {
  std::vector<std::uint32_t> rows(size);
  std::iota(rows.begin(), rows.end(), 0);
  return rows;
}

/// Steps that the mean of each Gaussian took.
template <typename T>
std::vector<std::uint32_t> means_steps(const Adam<T>& adam) {
  std::vector<std::uint32_t> result;
  const auto& steps = adam.state().steps;
  for (std::size_t i = 0; i < steps.size(); i += kAdamGroups) result.push_back(steps[i]);
  return result;
}

/// Algorithm 1 of Kingma & Ba for one number.
struct ScalarAdam {
  double value, first = 0, second = 0;
  int steps = 0;
  void step(double gradient, double rate) {
    ++steps;
    first = 0.9 * first + 0.1 * gradient;
    second = 0.999 * second + 0.001 * gradient * gradient;
    value -= rate * (first / (1 - std::pow(0.9, steps))) /
             (std::sqrt(second / (1 - std::pow(0.999, steps))) + 1e-15);
  }
};

template <typename T>
class AdamTest : public ::testing::Test {
 public:
  static constexpr double kTolerance = sizeof(T) == 4 ? 1e-5 : 1e-13;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(AdamTest, Scalars);

TYPED_TEST(AdamTest, EveryParameterFollowsTheDefinition) {
  using T = TypeParam;
  constexpr std::size_t kSize = 5;
  auto map = random_map<T>(kSize);
  Adam<T> adam(kSize, kBases, kDims);
  std::vector<std::vector<ScalarAdam>> expected;
  const auto arrays = [](auto& m) {
    return std::vector<Array<T>*>{&m.means,           &m.quats, &m.log_scales,
                                  &m.logit_opacities, &m.sh,    &m.features};
  };
  for (const Array<T>* array : arrays(map)) {
    expected.emplace_back();
    for (T value : *array) expected.back().push_back({double(value)});
  }
  // Gaussian 3 takes part in every second step only.
  for (int step = 0; step < 20; ++step) {
    const auto rows = step % 2 ? std::vector<std::uint32_t>{0, 1, 2, 4} : all_rows(kSize);
    auto gradients = random_gradients<T>(rows, std::uint32_t(step));
    adam.step(map, gradients.view(), kRates);
    const std::vector<const Array<T>*> by_array = {
        &gradients.dL_dmeans,           &gradients.dL_dquats, &gradients.dL_dlog_scales,
        &gradients.dL_dlogit_opacities, &gradients.dL_dsh,    &gradients.dL_dfeatures};
    const double rates[] = {0.01, 0.02, 0.03, 0.04, 0.05, 0.07};
    for (std::size_t a = 0; a < expected.size(); ++a) {
      const std::size_t columns = expected[a].size() / kSize;
      for (std::size_t i = 0; i < rows.size(); ++i) {
        for (std::size_t k = 0; k < columns; ++k) {
          const double rate = a == 4 && k >= 3 ? 0.06 : rates[a];
          expected[a][rows[i] * columns + k].step(double((*by_array[a])[i * columns + k]), rate);
        }
      }
    }
  }
  const auto found = arrays(map);
  for (std::size_t a = 0; a < expected.size(); ++a) {
    for (std::size_t k = 0; k < expected[a].size(); ++k) {
      EXPECT_NEAR((*found[a])[k], expected[a][k].value, TestFixture::kTolerance) << a << " " << k;
    }
  }
  EXPECT_THAT(means_steps(adam), ::testing::ElementsAre(20, 20, 20, 10, 20));
}

TYPED_TEST(AdamTest, GaussiansNotSeenStayBitForBit) {
  auto map = random_map<TypeParam>(4);
  const auto before = map;
  Adam<TypeParam> adam(4, kBases, kDims);
  adam.step(map, random_gradients<TypeParam>({1, 2}, 1).view(), kRates);
  for (std::size_t row : {0u, 3u}) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(map.means[3 * row + k], before.means[3 * row + k]);
      EXPECT_EQ(map.sh[3 * kBases * row + k], before.sh[3 * kBases * row + k]);
    }
    EXPECT_EQ(means_steps(adam)[row], 0u);
  }
  EXPECT_NE(map.means[3], before.means[3]);
}

TYPED_TEST(AdamTest, AGroupWithoutARateStays) {
  auto map = random_map<TypeParam>(3);
  const auto before = map;
  Adam<TypeParam> adam(3, kBases, kDims);
  AdamRates rates;
  rates.sh_rest = 0.1;
  adam.step(map, random_gradients<TypeParam>(all_rows(3), 1).view(), rates);
  EXPECT_EQ(map.means, before.means);
  EXPECT_EQ(map.sh[0], before.sh[0]);
  EXPECT_NE(map.sh[3], before.sh[3]);
}

TYPED_TEST(AdamTest, AGroupThatIsFreedMovesAsInANewAdam) {
  auto map = random_map<TypeParam>(2);
  Adam<TypeParam> adam(2, kBases, kDims), fresh(2, kBases, kDims);
  AdamRates others = kRates;
  others.means = others.sh_rest = 0;
  const auto step = [](auto& optimizer, auto& on, std::uint32_t seed, const AdamRates& rates) {
    optimizer.step(on, random_gradients<TypeParam>(all_rows(2), seed).view(), rates);
  };
  for (std::uint32_t i = 0; i < 200; ++i) step(adam, map, i, others);
  auto copy = map;
  for (std::uint32_t i = 200; i < 205; ++i) {
    step(adam, map, i, kRates);
    step(fresh, copy, i, kRates);
  }
  EXPECT_EQ(map.means, copy.means);
  EXPECT_EQ(map.sh[3], copy.sh[3]);
  EXPECT_NE(map.sh[0], copy.sh[0]);
}

TYPED_TEST(AdamTest, StepsAreCountedToALimit) {
  auto map = random_map<TypeParam>(1);
  Adam<TypeParam> adam(1, kBases, kDims);
  auto state = adam.state();
  state.steps.assign(kAdamGroups, kMaxAdamSteps - 1);
  Adam<TypeParam> late(state);
  for (std::uint32_t i = 0; i < 3; ++i) {
    late.step(map, random_gradients<TypeParam>({0}, i).view(), kRates);
    EXPECT_THAT(late.state().steps, ::testing::Each(kMaxAdamSteps));
  }
  for (TypeParam mean : map.means) EXPECT_TRUE(std::isfinite(mean));
}

TYPED_TEST(AdamTest, GoesOnFromItsStateExactly) {
  auto map = random_map<TypeParam>(6);
  Adam<TypeParam> adam(6, kBases, kDims);
  const auto step = [](auto& optimizer, auto& on, std::uint32_t seed) {
    optimizer.step(on, random_gradients<TypeParam>({0, 2, 5}, seed).view(), kRates);
  };
  for (std::uint32_t i = 0; i < 5; ++i) step(adam, map, i);
  auto copy = map;
  Adam<TypeParam> restored(adam.state());
  for (std::uint32_t i = 5; i < 10; ++i) {
    step(adam, map, i);
    step(restored, copy, i);
  }
  EXPECT_EQ(map.means, copy.means);
  EXPECT_EQ(map.features, copy.features);
  EXPECT_EQ(adam.state().second, restored.state().second);
}

TYPED_TEST(AdamTest, SelectTakesTheMomentsAlong) {
  auto map = random_map<TypeParam>(3);
  Adam<TypeParam> adam(3, kBases, kDims);
  adam.step(map, random_gradients<TypeParam>({0, 2}, 1).view(), kRates);
  const Adam<TypeParam> selected = adam.select({2, -1, 0, 2});
  EXPECT_THAT(means_steps(selected), ::testing::ElementsAre(1, 0, 1, 1));
  constexpr std::size_t kParameters = 11 + 3 * kBases + kDims;
  for (std::size_t k = 0; k < kParameters; ++k) {
    EXPECT_EQ(selected.state().first[k], adam.state().first[2 * kParameters + k]);
    EXPECT_EQ(selected.state().first[kParameters + k], 0);
    EXPECT_EQ(selected.state().second[2 * kParameters + k], adam.state().second[k]);
    EXPECT_EQ(selected.state().second[3 * kParameters + k],
              adam.state().second[2 * kParameters + k]);
  }
}

TYPED_TEST(AdamTest, DoesNotDependOnThreads) {
  constexpr std::size_t kSize = 10'000;
  const auto gradients = random_gradients<TypeParam>(all_rows(kSize), 1);
  auto expected = random_map<TypeParam>(kSize);
  Adam<TypeParam>(kSize, kBases, kDims).step(expected, gradients.view(), kRates, 1);
  for (int threads : {2, 3, 7}) {
    auto map = random_map<TypeParam>(kSize);
    Adam<TypeParam>(kSize, kBases, kDims).step(map, gradients.view(), kRates, threads);
    EXPECT_EQ(map.means, expected.means);
    EXPECT_EQ(map.sh, expected.sh);
  }
}

TYPED_TEST(AdamTest, HugeAndTinyGradientsGiveNumbers) {
  auto map = random_map<TypeParam>(2);
  Adam<TypeParam> adam(2, kBases, kDims);
  auto gradients = random_gradients<TypeParam>({0, 1}, 1);
  gradients.dL_dmeans[0] = std::numeric_limits<TypeParam>::max();
  gradients.dL_dmeans[1] = std::numeric_limits<TypeParam>::denorm_min();
  gradients.dL_dmeans[2] = 0;
  for (int i = 0; i < 50; ++i) adam.step(map, gradients.view(), kRates);
  for (TypeParam mean : map.means) EXPECT_TRUE(std::isfinite(mean));
  for (TypeParam second : adam.state().second) EXPECT_TRUE(std::isfinite(second));
}

TYPED_TEST(AdamTest, NamesWhatIsWrongAndChangesNothing) {
  auto map = random_map<TypeParam>(3);
  const auto before = map;
  Adam<TypeParam> adam(3, kBases, kDims);
  const auto expect_error = [&](auto call, const std::string& text) {
    try {
      call();
      FAIL() << "no error: " << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(text));
    }
    EXPECT_EQ(map.means, before.means);
    EXPECT_THAT(adam.state().steps, ::testing::Each(0u));
  };
  const auto good = random_gradients<TypeParam>({0, 1}, 1);
  const auto step_with = [&](auto change) {
    return [&, change] {
      auto gradients = good;
      change(gradients);
      adam.step(map, gradients.view(), kRates);
    };
  };
  expect_error(step_with([](auto& g) { g.rows[1] = 0; }), "rows[1] is 0");
  expect_error(step_with([](auto& g) { g.rows[1] = 3; }), "below 3, rows[1] is 3");
  expect_error(step_with([](auto& g) { g.dL_dsh.pop_back(); }), "dL_dsh must hold 2 x 12");
  expect_error(
      step_with([](auto& g) { g.dL_dquats[5] = std::numeric_limits<TypeParam>::infinity(); }),
      "Adam::step: dL_dquats has inf at 5, must be finite");
  expect_error(step_with([](auto& g) {
                 g.feature_dims = 0;
                 g.dL_dfeatures.clear();
               }),
               "the state is of 4 SH bases and 2 features, gradients of 4 and 0");
  AdamRates negative = kRates;
  negative.quats = -1;
  expect_error([&] { adam.step(map, good.view(), negative); }, "rates must not be negative");
  auto other = random_map<TypeParam>(2);
  expect_error([&] { adam.step(other, good.view(), kRates); },
               "the state is of 3 Gaussians with 4 SH bases and 2 features, map has 2");
  expect_error([&] { adam.select({0, 3}); }, "rows[1] is 3, must be -1 or below 3");
  expect_error([&] { Adam<TypeParam>(3, 5); }, "sh_bases");
  expect_error([&] { Adam<TypeParam>(3, 4, 0, {1.0, 0.999, 1e-15}); }, "beta1 and beta2");
  auto state = adam.state();
  state.second.pop_back();
  expect_error([&] { Adam<TypeParam>{state}; }, "3 Gaussians need 75 first and second moments");
  const auto error_with = [&](auto change, const std::string& text) {
    auto changed = adam.state();
    change(changed);
    expect_error([&] { Adam<TypeParam>{changed}; }, text);
  };
  const TypeParam nan = std::numeric_limits<TypeParam>::quiet_NaN();
  error_with([&](auto& s) { s.first[4] = nan; }, "Adam: first has nan at 4, must be finite");
  error_with([&](auto& s) { s.second[7] = 1 / TypeParam(0); }, "Adam: second has inf at 7");
  error_with([](auto& s) { s.second[2] = -1; }, "Adam: second must not be negative, got -1 at 2");
  error_with([](auto& s) { s.steps[5] = kMaxAdamSteps + 1; },
             "Adam: steps must be at most 1048576, got 1048577 at 5");
  error_with([](auto& s) { s.steps.pop_back(); }, "steps must hold 7 numbers a Gaussian, got 20");
}

}  // namespace
}  // namespace gslts::optim
