#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "gslts/map/gaussian_map.hpp"

namespace gslts {
namespace {

GaussianMap wavy_map(std::size_t size) {
  GaussianMap map = make_gaussian_map<float>(size, 1);
  for (std::size_t i = 0; i < map.means.size(); ++i) map.means[i] = std::sin(0.7f * float(i)) * 9;
  for (std::size_t i = 0; i < map.log_scales.size(); ++i) {
    map.log_scales[i] = std::cos(0.3f * float(i)) - 4;
  }
  for (auto* array : {&map.quats, &map.logit_opacities, &map.sh}) {
    std::fill(array->begin(), array->end(), 1.0f);
  }
  return map;
}

TEST(ChunkBounds, EveryGaussianIsInTheTightBoxOfItsChunk) {
  for (std::size_t size : {std::size_t(0), std::size_t(1), kChunkSize, 2 * kChunkSize + 5}) {
    const GaussianMap map = wavy_map(size);
    const ChunkBounds bounds = chunk_bounds(map.view(), "test");
    EXPECT_EQ(bounds.size, size);
    ASSERT_EQ(bounds.chunks.size(), (size + kChunkSize - 1) / kChunkSize);
    for (std::size_t chunk = 0; chunk < bounds.chunks.size(); ++chunk) {
      const ChunkBounds::Box& box = bounds.chunks[chunk];
      const std::size_t begin = chunk * kChunkSize, end = std::min(size, begin + kChunkSize);
      for (int axis = 0; axis < 3; ++axis) {
        double low = 1e9, high = -1e9;
        for (std::size_t row = begin; row < end; ++row) {
          low = std::min(low, double(map.means[3 * row + std::size_t(axis)]));
          high = std::max(high, double(map.means[3 * row + std::size_t(axis)]));
        }
        EXPECT_EQ(box.low[axis], low);
        EXPECT_EQ(box.high[axis], high);
      }
      EXPECT_EQ(box.max_log_scale, *std::max_element(map.log_scales.begin() + long(3 * begin),
                                                     map.log_scales.begin() + long(3 * end)));
    }
  }
}

TEST(ChunkBounds, NumbersThatAreNotFiniteAreRejected) {
  for (float bad : {std::numeric_limits<float>::quiet_NaN(), HUGE_VALF}) {
    GaussianMap map = wavy_map(kChunkSize + 3);
    map.sh.back() = bad;
    EXPECT_THROW(chunk_bounds(map.view(), "test"), std::invalid_argument);
    map = wavy_map(kChunkSize + 3);
    map.means.front() = bad;
    EXPECT_THROW(chunk_bounds(map.view(), "test"), std::invalid_argument);
  }
}

TEST(ChunkBounds, BoundsOfAnotherMapAreRejected) {
  const GaussianMap map = wavy_map(10), other = wavy_map(11);
  const ChunkBounds bounds = chunk_bounds(other.view(), "test");
  GaussianView<float> view = map.view();
  view.bounds = &bounds;
  EXPECT_THROW(validate(view, "test"), std::invalid_argument);
}

}  // namespace
}  // namespace gslts
