#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

#include "gslts/io/ply.hpp"
#include "ply_files.hpp"

namespace gslts::io {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST_F(PlyFile, RoundTripKeepsEveryBit) {
  for (std::size_t size : {0u, 1u, 3000u}) {  // 3000 rows are several blocks.
    for (int bases : {1, 4, 9, 16}) {
      GaussianMap map = random_map(size, bases, bases == 4 ? 5 : 0);
      write_ply(map.view(), map.ids.data(), path());
      const PlyContents read = read_ply(path());
      expect_same(read.map, map);
      EXPECT_THAT(read.ignored_properties, IsEmpty());
      expect_same(parse_ply(contents(), "a.ply").map, map);
    }
  }
}

TEST_F(PlyFile, RoundTripOfLongRows) {
  const GaussianMap map = random_map(19, 1, 9000);
  write_ply(map.view(), nullptr, path());
  expect_same(read_ply(path()).map, map);
}

TEST_F(PlyFile, RoundTripKeepsIdsAndOrigin) {
  GaussianMap map = random_map(3, 4, 2);
  map.ids = {std::numeric_limits<std::uint64_t>::max(), 0, (std::uint64_t{1} << 32) + 7};
  map.origin = {4512345.678901234, -0.0, 5e-324};
  write_ply(map.view(), map.ids.data(), path());
  expect_same(read_ply(path()).map, map);
  map.origin.setZero();
  map.origin(2) = -0.0;
  write_ply(map.view(), map.ids.data(), path());
  expect_same(read_ply(path()).map, map);
}

TEST_F(PlyFile, WritesTheLayoutOf3dgs) {
  GaussianMap map = random_map(1, 4);
  write_ply(map.view(), nullptr, path());
  std::string expected = replace(kHeader, "ascii", "binary_little_endian");
  expected = replace(expected, "vertex 2", "vertex 1");
  expected = replace(expected, "float z\n",
                     "float z\nproperty float nx\nproperty float ny\nproperty float nz\n");
  expected = replace(expected, "float f_dc_2\n", "float f_dc_2\n" + numbered("f_rest_", 9));
  EXPECT_EQ(contents().substr(0, expected.size()), expected);
  const auto& sh = map.sh;
  const float row[] = {map.means[0],
                       map.means[1],
                       map.means[2],
                       0,
                       0,
                       0,  // Normals.
                       sh[0],
                       sh[1],
                       sh[2],
                       sh[3],
                       sh[6],
                       sh[9],  // Red of degree 1.
                       sh[4],
                       sh[7],
                       sh[10],  // Green.
                       sh[5],
                       sh[8],
                       sh[11],  // Blue.
                       map.logit_opacities[0],
                       map.log_scales[0],
                       map.log_scales[1],
                       map.log_scales[2],
                       map.quats[0],
                       map.quats[1],
                       map.quats[2],
                       map.quats[3]};
  EXPECT_EQ(contents().substr(expected.size()),
            std::string(reinterpret_cast<const char*>(row), sizeof(row)));
}

TEST(Ply, ReadsText) {
  expect_text_map(parse_ply(kText, "a.ply").map);
  std::string crlf;
  for (char c : kText) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  expect_text_map(parse_ply(crlf, "a.ply").map);
  expect_text_map(parse_ply(kText.substr(0, kText.size() - 1), "a.ply").map);
  expect_text_map(parse_ply(kText + " \n\r\n\t", "a.ply").map);
  expect_text_map(parse_ply(replace(kText, "1 2 3", "  +1.0 \t 2e0  .3e1"), "a.ply").map);
  expect_text_map(
      parse_ply(replace(kText, "element", "comment\ncomment \xff\nobj_info x y\nelement"), "a.ply")
          .map);
}

TEST(Ply, TextTooSmallForAFloatIsZero) {
  EXPECT_EQ(parse_ply(replace(kText, "1 2 3", "1e-60 2 3"), "a.ply").map.means[0], 0.0f);
  EXPECT_EQ(parse_ply(replace(kText, "1 2 3", "1e-45 2 3"), "a.ply").map.means[0],
            std::numeric_limits<float>::denorm_min());
}

TEST(Ply, NamesThePropertiesThatItIgnores) {
  std::string text = replace(kText, "property float x",
                             "property list uchar int seen\n"
                             "property uchar red\n"
                             "property float f_rest_00\n"
                             "property float nx\n"
                             "property float x");
  text = replace(text, "1 2 3", "3 7 8 9 255 1 0 1 2 3");
  text = replace(text, "-1 -2 -3", "0 0 1 0 -1 -2 -3");
  const PlyContents contents = parse_ply(text, "a.ply");
  expect_text_map(contents.map);
  EXPECT_THAT(contents.ignored_properties, ElementsAre("seen", "red", "f_rest_00"));
}

TEST(Ply, SkipsOtherElements) {
  std::string text = replace(kText, "element vertex",
                             "element camera 2\n"
                             "property list int float view\n"
                             "property char kind\n"
                             "element nothing 0\n"
                             "element vertex");
  text = replace(text, "end_header\n",
                 "element face 1\nproperty list uchar uint vertex_indices\n"
                 "end_header\n2 0.5 1 -7\n0 127\n");
  text += "3 0 1 4294967295\n";
  const PlyContents contents = parse_ply(text, "a.ply");
  expect_text_map(contents.map);
  EXPECT_THAT(contents.ignored_properties, IsEmpty());
}

TEST(Ply, ReadsTheOrigin) {
  const auto origin_of = [](const std::string& comment) {
    return parse_ply(replace(kText, "element", comment + "\nelement"), "a.ply").map.origin;
  };
  EXPECT_EQ(origin_of("comment gslts origin 1e6 -2.5 0.1"), Eigen::Vector3d(1e6, -2.5, 0.1));
  EXPECT_EQ(origin_of("comment gslts original 1"), Eigen::Vector3d::Zero());
  const std::string expected =
      "a.ply: header line 3: expected comment gslts origin X Y Z with finite numbers";
  for (const char* wrong : {"1 2", "1 2 3 4", "1 2 inf", "1 2 x", "1 2 nan"}) {
    EXPECT_EQ(error_of([&] { origin_of(std::string("comment gslts origin ") + wrong); }), expected);
  }
  EXPECT_EQ(error_of([&] { origin_of("comment gslts origin 1 2 3\ncomment gslts origin 1 2 3"); }),
            "a.ply: header line 4: second origin");
}

/// A map of a survey: UTM coordinates in double, and an outlier.
TEST(Ply, CentresFarOutInDoubleKeepTheirMillimetres) {
  std::string text = kText;
  for (const char* axis : {"x", "y", "z"}) {
    text = replace(text, std::string("property float ") + axis,
                   std::string("property double ") + axis);
  }
  text = replace(text, "vertex 2", "vertex 3");
  text = replace(text, "1 2 3", "0 0 0 1 1 1 1 1 1 1 1 1 1 1\n500000.001 5400000.004 -2");
  text = replace(text, "-1 -2 -3", "500000.506 5400000.009 -2.25");
  const GaussianMap map = parse_ply(text, "a.ply").map;
  EXPECT_EQ(map.origin, Eigen::Vector3d(500000, 5400000, -2));
  const double expected[] = {-500000, -5400000, 2, 0.001, 0.004, 0, 0.506, 0.009, -0.25};
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(map.means[std::size_t(i)], expected[i], 1e-6) << i;
  // What float holds to 0.1 mm, and our own files, stay as they are.
  const std::string near = replace(replace(text, "500000.001 5400000.004", "500.001 -2047"),
                                   "500000.506 5400000.009", "600 1");
  EXPECT_EQ(parse_ply(near, "a.ply").map.origin, Eigen::Vector3d::Zero());
  EXPECT_EQ(parse_ply(near, "a.ply").map.means[3], 500.001f);
  const std::string ours = replace(text, "element", "comment gslts origin 0 0 0\nelement");
  EXPECT_EQ(parse_ply(ours, "a.ply").map.origin, Eigen::Vector3d::Zero());
  EXPECT_EQ(parse_ply(ours, "a.ply").map.means[3], 500000.001f);
}

}  // namespace
}  // namespace gslts::io
