#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/map/pixel_mask.hpp"

namespace gslts {
namespace {

void expect_box(const PixelBox& box, int x0, int y0, int x1, int y1) {
  EXPECT_EQ(box.x0, x0);
  EXPECT_EQ(box.y0, y0);
  EXPECT_EQ(box.x1, x1);
  EXPECT_EQ(box.y1, y1);
}

TEST(PixelMask, NullMeansThatAllPixelsAreWanted) {
  const PixelMask mask;
  EXPECT_TRUE(mask.all());
  EXPECT_TRUE(mask.pixel(3, 1));
  expect_box(bounds_of(mask, 5, 4), 0, 0, 5, 4);
  EXPECT_NO_THROW(validate(mask, 5, 4, "f"));
}

TEST(PixelMask, BoundsHoldAllWantedPixels) {
  std::vector<std::uint8_t> wanted(5 * 4, 0);
  const PixelMask mask{wanted.data(), 5, 4};
  expect_box(bounds_of(mask, 5, 4), 0, 0, 0, 0);
  wanted[1 * 5 + 3] = 1;
  expect_box(bounds_of(mask, 5, 4), 3, 1, 4, 2);
  wanted[3 * 5 + 1] = 255;
  expect_box(bounds_of(mask, 5, 4), 1, 1, 4, 4);
  EXPECT_TRUE(mask.pixel(1, 3));
  EXPECT_FALSE(mask.pixel(0, 0));
}

TEST(PixelMask, AnotherSizeIsRejected) {
  const std::vector<std::uint8_t> wanted(5 * 4, 1);
  try {
    validate({wanted.data(), 5, 4}, 4, 5, "f");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()), "f: mask is 5 x 4 pixels, but the image is 4 x 5");
  }
}

}  // namespace
}  // namespace gslts
