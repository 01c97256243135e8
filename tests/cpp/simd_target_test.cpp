#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "gslts/simd/target.hpp"

namespace gslts::simd {
namespace {

TEST(SimdTarget, UnknownNamesAreRefusedAndNothingChanges) {
  const std::string before = target();
  for (const std::string name : {"", "AVX2", "avx1024", targets()[0] == "neon" ? "avx2" : "neon"}) {
    try {
      use_target(name);
      FAIL() << name;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what())
                    .find("\"" + name + "\", but this machine can use " + targets()[0]),
                std::string::npos)
          << error.what();
    }
  }
  EXPECT_EQ(target(), before);
}

}  // namespace
}  // namespace gslts::simd
