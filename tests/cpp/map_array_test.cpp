#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <thread>
#include <vector>

#include "gslts/map/array.hpp"

namespace gslts {
namespace {

TEST(ArrayTest, IsAlignedToCacheLines) {
  for (std::size_t n : {1u, 100u, 20'000u, 300'000u, 2'000'000u}) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Array<float>(n).data()) % 64, 0u) << n;
  }
}

/// Arrays of all sizes that come and go, each filled with a number of its own that must stay.
void churn(std::uint32_t seed) {
  std::vector<Array<std::uint32_t>> arrays(8);
  std::uint32_t random = seed;
  for (std::uint32_t step = 0; step < 300; ++step) {
    random = random * 1664525u + 1013904223u;
    Array<std::uint32_t>& array = arrays[random >> 29];
    for (std::uint32_t value : array) ASSERT_EQ(value, array.front());
    array = {};
    array.assign((random >> 8) % (1u << ((random >> 4) % 19)), seed + step);
  }
}

TEST(ArrayTest, LiveArraysNeverShareMemory) {
  std::vector<std::thread> threads;
  for (std::uint32_t seed = 1; seed <= 4; ++seed) {
    threads.emplace_back([seed] { churn(seed * 1000); });
  }
  for (std::thread& thread : threads) thread.join();
}

// The address sanitizer ends the program instead of reporting that memory is missing, and recycles
// nothing.
#ifndef __SANITIZE_ADDRESS__
TEST(ArrayTest, MoreThanMemoryHoldsIsRefused) {
  Array<double> array;
  EXPECT_THROW(array.resize(std::size_t{1} << 58), std::bad_alloc);
  EXPECT_TRUE(array.empty());
}

TEST(ArrayTest, AReleasedBlockIsUsedAgain) {
  const float* first = nullptr;
  {
    const Array<float> array(500'000);
    first = array.data();
  }
  EXPECT_EQ(Array<float>(500'000).data(), first);
}
#endif

}  // namespace
}  // namespace gslts
