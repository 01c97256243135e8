#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "ply_files.hpp"

namespace gslts::io {
namespace {

/// Bounds from 0 to 1, -8 to 0 and, for the colours, 0 to 2, and one Gaussian in text.
std::string compressed(const std::string& vertex, const std::string& harmonics_header = "",
                       const std::string& harmonics = "") {
  std::string text = "ply\nformat ascii 1.0\nelement chunk 1\n";
  for (const char* kind : {"_", "_scale_"}) {
    for (const char* limit : {"min", "max"}) {
      for (char axis : {'x', 'y', 'z'})
        text += std::string("property float ") + limit + kind + axis + '\n';
    }
  }
  for (const char* limit : {"min_", "max_"}) {
    for (char channel : {'r', 'g', 'b'})
      text += std::string("property float ") + limit + channel + '\n';
  }
  text += "element vertex 1\n";
  for (const char* name : {"position", "rotation", "scale", "color"}) {
    text += std::string("property uint packed_") + name + '\n';
  }
  return text + harmonics_header + "end_header\n0 0 0 1 1 1 -8 -8 -8 0 0 0 0 0 0 2 2 2\n" + vertex +
         harmonics;
}

std::string text_of(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  return std::to_string(a) + ' ' + std::to_string(b) + ' ' + std::to_string(c) + ' ' +
         std::to_string(d) + '\n';
}

TEST(CompressedPly, EveryNumberOfAGaussian) {
  const std::uint32_t position = 2047u << 21 | 0u << 11 | 1023u;
  const std::uint32_t rotation = 2u << 30 | 1023u << 20 | 0u << 10 | 512u;
  const std::uint32_t scale = 0u << 21 | 1023u << 11 | 2047u;
  const std::uint32_t color = 255u << 24 | 0u << 16 | 51u << 8 | 204u;
  const GaussianMap map =
      parse_ply(compressed(text_of(position, rotation, scale, color)), "a.ply").map;
  ASSERT_EQ(map.size(), 1u);
  EXPECT_EQ(map.means[0], 1);
  EXPECT_EQ(map.means[1], 0);
  EXPECT_FLOAT_EQ(map.means[2], 1023 / 2047.f);
  EXPECT_FLOAT_EQ(map.quats[0], std::sqrt(0.5f));   // w
  EXPECT_FLOAT_EQ(map.quats[1], -std::sqrt(0.5f));  // x
  EXPECT_NEAR(map.quats[2], 0, 2e-3);               // y, the largest of the file: 1 - 0.5 - 0.5.
  EXPECT_NEAR(map.quats[3], 0, 1e-3);               // z
  EXPECT_EQ(map.log_scales[0], -8);
  EXPECT_EQ(map.log_scales[1], 0);
  EXPECT_EQ(map.log_scales[2], 0);
  const float sh0 = 0.28209479177387814f;
  EXPECT_FLOAT_EQ(map.sh[0], 1.5f / sh0);
  EXPECT_FLOAT_EQ(map.sh[1], -0.5f / sh0);
  EXPECT_FLOAT_EQ(map.sh[2], -0.1f / sh0);
  EXPECT_FLOAT_EQ(map.logit_opacities[0], std::log(4.f));
}

TEST(CompressedPly, OpaqueAndTransparentAreFinite) {
  EXPECT_EQ(parse_ply(compressed(text_of(0, 0, 0, 255)), "a").map.logit_opacities[0], 20);
  EXPECT_EQ(parse_ply(compressed(text_of(0, 0, 0, 0)), "a").map.logit_opacities[0], -20);
}

TEST(CompressedPly, HarmonicsAreReadByChannel) {
  std::string header = "element sh 1\n";
  for (int i = 0; i < 9; ++i) header += "property uchar f_rest_" + std::to_string(i) + '\n';
  const std::string text = compressed(text_of(0, 0, 0, 0), header, "0 255 127 3 4 5 6 7 8\n");
  const GaussianMap map = parse_ply(text, "a.ply").map;
  ASSERT_EQ(map.sh_bases, 4);
  EXPECT_EQ(map.sh[3], -4);                       // Basis 1, red.
  EXPECT_EQ(map.sh[6], 4);                        // Basis 2, red.
  EXPECT_EQ(map.sh[9], -1 / 64.f);                // Basis 3, red.
  EXPECT_EQ(map.sh[4], 8 * (3.5f / 256 - 0.5f));  // Basis 1, green.
  EXPECT_EQ(map.sh[5], 8 * (6.5f / 256 - 0.5f));  // Basis 1, blue.
}

TEST(CompressedPly, SaysWhatIsWrong) {
  const std::string good = compressed(text_of(0, 0, 0, 0));
  const auto error = [&](const std::string& before, const std::string& after) {
    return parse_error(replace(good, before, after));
  };
  EXPECT_EQ(error("element chunk", "element chunks"),
            "a.ply: header line 22: packed vertices without an element 'chunk' before them");
  EXPECT_EQ(error("vertex 1", "vertex 0"),
            "a.ply: header line 3: expected 0 chunks for 0 vertices, got 1");
  EXPECT_EQ(error("property float max_b\n", ""),
            "a.ply: header line 3: element 'chunk' lacks property 'max_b'");
  EXPECT_EQ(error("float max_x", "double max_x"),
            "a.ply: header line 7: 'max_x' must be of type float");
  EXPECT_EQ(error("uint packed_color", "int packed_color"),
            "a.ply: header line 26: 'packed_color' must be of type uint");
  EXPECT_EQ(error("uint packed_scale", "uint packed_scales"),
            "a.ply: header line 22: element 'vertex' lacks property 'packed_scale'");
  EXPECT_EQ(error("0 0 0 1", "0 nan 0 1"), "a.ply: chunk 0: a bound is not finite");
  EXPECT_EQ(error("2 2 2\n0 0 0 0", "3e38 2 2\n0 0 0 4278190080"),
            "a.ply: vertex 0: packed_color: a value exceeds float");
  EXPECT_EQ(error("end_header", "element sh 1\nproperty uchar f_rest_0\nend_header"),
            "a.ply: header line 27: degrees 1 to 3 have 9, 24 or 45 properties f_rest_, got 1");
  std::string nine = "element sh 2\n";
  for (int i = 0; i < 9; ++i) nine += "property uchar f_rest_" + std::to_string(i) + '\n';
  EXPECT_EQ(parse_error(compressed(text_of(0, 0, 0, 0), nine, repeat("0 0 0 0 0 0 0 0 0\n", 2))),
            "a.ply: header line 27: element 'sh' has 2 rows, element 'vertex' 1");
}

}  // namespace
}  // namespace gslts::io
