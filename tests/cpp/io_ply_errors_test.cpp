#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <limits>
#include <string>
#include <system_error>

#include "gslts/io/ply.hpp"
#include "ply_files.hpp"

namespace gslts::io {
namespace {

struct Wrong {
  std::string before, after;  ///< Text of `kText`, and its wrong replacement.
  std::string message;        ///< Error message after "a.ply: ".
};

TEST(Ply, SaysWhatIsWrongWithTheHeader) {
  const std::string long_name(300, 'n');
  const Wrong cases[] = {
      {kText, "", "no PLY file: it does not begin with 'ply'"},
      {"ply\n", "plyx\n", "header line 1: expected 'ply', got 'plyx'"},
      {"format ascii 1.0\n", "", "header line 17: the header has no format"},
      {"format ascii 1.0\n", "format ascii 1.0\nformat ascii 1.0\n",
       "header line 3: second format"},
      {"ascii 1.0", "ascii 1.1",
       "header line 2: expected format ascii, binary_little_endian or binary_big_endian 1.0, got "
       "'format ascii 1.1'"},
      {"element vertex 2", "element vertex",
       "header line 3: expected element NAME ROWS, got 'element vertex'"},
      {"vertex 2", "vertex -2",
       "header line 3: the number of rows must be an integer from 0 to 2^64 - 1, got '-2'"},
      {"vertex 2", "vertex 18446744073709551616",
       "header line 3: the number of rows must be an integer from 0 to 2^64 - 1, got "
       "'18446744073709551616'"},
      {"vertex 2", "vertex 2.0",
       "header line 3: the number of rows must be an integer from 0 to 2^64 - 1, got '2.0'"},
      {"vertex 2", "vertex 1099511627776",
       "header line 3: element 'vertex' of 1099511627776 rows, each of 28 bytes or more, but only "
       "80 bytes follow the header"},
      {"vertex 2", "vertex 18446744073709551615",
       "header line 3: element 'vertex' of 18446744073709551615 rows, each of 28 bytes or more, "
       "but only 80 bytes follow the header"},
      {"vertex 2", "vertices 2", "the header has no element 'vertex'"},
      {"end_header", "element vertex 0\nend_header", "header line 18: second element 'vertex'"},
      {"end_header", "element face 1\nend_header",
       "header line 18: element 'face' has rows but no properties"},
      {"element vertex 2\n", "", "header line 3: property before the first element"},
      {"property float y", "property float x", "header line 5: second property 'x'"},
      {"property float y", "property half y", "header line 5: unknown type 'half'"},
      {"property float y", "property y",
       "header line 5: expected property TYPE NAME or property list TYPE TYPE NAME, got 'property "
       "y'"},
      {"property float y", "property list uchar y",
       "header line 5: expected property TYPE NAME or property list TYPE TYPE NAME, got 'property "
       "list uchar y'"},
      {"property float y", "property list float int y",
       "header line 5: the length of a list must be an integer, got 'float'"},
      {"property float y", "property list int int y",
       "header line 5: 'y' must be a number, not a list"},
      {"property float y\n", "", "header line 3: element 'vertex' lacks property 'y'"},
      {"property float rot_3\n", "", "header line 3: element 'vertex' lacks property 'rot_3'"},
      {"property float scale_2\n", "",
       "header line 3: element 'vertex' lacks property 'scale_2': 2D Gaussians; only 3D ones are "
       "read"},
      {"property float opacity", "opacity",
       "header line 10: expected format, element, property, comment or end_header, got 'opacity'"},
      {"property float y", "",
       "header line 5: expected format, element, property, comment or end_header, got ''"},
      {"end_header", "end_header now",
       "header line 18: expected format, element, property, comment or end_header, got 'end_header "
       "now'"},
      {"float y", "float y\x80", "header line 5: unprintable character in 'property float y?'"},
      {"float y", "float " + long_name,
       "header line 5: longer than 256 bytes: 'property float " + long_name.substr(0, 45) + "...'"},
      {"end_header", numbered("f_rest_", 12) + "end_header",
       "header line 3: degrees 0 to 3 have 0, 9, 24 or 45 properties f_rest_, got 12"},
      {"end_header", "property float f_rest_1\nend_header",
       "header line 18: 'f_rest_1' without 'f_rest_0'"},
      {"end_header", "property float feature_0\nproperty float feature_2\nend_header",
       "header line 19: 'feature_2' without 'feature_1'"},
      {"end_header", "property uint id_low\nend_header",
       "header line 3: element 'vertex' lacks property 'id_high'"},
      {"end_header", "property uint id_low\nproperty int id_high\nend_header",
       "header line 19: 'id_high' must be of type uint"},
  };
  for (const Wrong& wrong : cases) {
    // What the header promises is there, unless the case says otherwise.
    const std::string text = replace(kText, wrong.before, wrong.after);
    const bool more = wrong.after.find("f_rest_") != wrong.after.npos ||
                      wrong.after.find("id_") != wrong.after.npos ||
                      wrong.after.find("feature_") != wrong.after.npos;
    EXPECT_EQ(parse_error(text + (more ? repeat(" 0", 100) : "")), "a.ply: " + wrong.message);
  }
}

TEST(Ply, SaysWhereTheHeaderEnds) {
  EXPECT_EQ(parse_error("ply"), "a.ply: header line 1: the file ends before end_header");
  EXPECT_EQ(parse_error(std::string(kHeader).substr(0, 30)),
            "a.ply: header line 3: the file ends before end_header");
  EXPECT_EQ(parse_error("ply\ncomment " + std::string(1 << 20, 'x') + '\n'),
            "a.ply: header line 2: the header does not end within 262144 bytes");
  EXPECT_EQ(parse_error("ply\n" + repeat("comment x\n", 1 << 15)),
            "a.ply: header line 26216: the header does not end within 262144 bytes");
}

TEST(Ply, SaysWhatIsWrongWithText) {
  const std::string digits(1001, '1');
  const Wrong cases[] = {
      {"-7 -8", "-8", "vertex 1: rot_3: the line ends here"},
      {"-13 -14\n", "", "vertex 1: rot_2: the file ends here"},
      {"13 14", "13 14 15", "vertex 0: the line has more numbers than properties"},
      {"13 14\n", "13 14\n\n", "vertex 1: x: the line ends here"},
      {"-7", "7x", "vertex 1: opacity: expected a number of type float, got '7x'"},
      {"-7", "0x7", "vertex 1: opacity: expected a number of type float, got '0x7'"},
      {"-7", "+-7", "vertex 1: opacity: expected a number of type float, got '+-7'"},
      {"-7", "1e999", "vertex 1: opacity: expected a number of type float, got '1e999'"},
      {"-7", "nan", "vertex 1: opacity: expected a finite float, got nan"},
      {"-1 ", "-inf ", "vertex 1: x: expected a finite float, got -inf"},
      {"-1 ", "1e39 ", "vertex 1: x: expected a finite float, got inf"},
      {"-8", "inf", "vertex 1: scale_0: expected a finite float, got inf"},
      {"-8", "nan", "vertex 1: scale_0: expected a finite float, got nan"},
      {"-7", digits, "vertex 1: opacity: expected a number, got '" + digits.substr(0, 60) + "...'"},
      {"float opacity", "uchar opacity",
       "vertex 1: opacity: expected a number of type uchar, got '-7'"},
      {"-13 -14\n", "-13 -14\n7\n", "2 bytes follow the last row"},
  };
  for (const Wrong& wrong : cases) {
    EXPECT_EQ(parse_error(replace(kText, wrong.before, wrong.after)), "a.ply: " + wrong.message);
  }
}

TEST(Ply, SaysWhatIsWrongWithListsInText) {
  const std::string text = replace(kText, "end_header\n",
                                   "element face 1\n"
                                   "property list char short a\n"
                                   "end_header\n");
  EXPECT_EQ(parse_error(text + "-1\n"), "a.ply: face 0: a: a list cannot have the length -1");
  EXPECT_EQ(parse_error(text + "128\n"),
            "a.ply: face 0: a: expected a number of type char, got '128'");
  EXPECT_EQ(parse_error(text + "2 1\n3"), "a.ply: face 0: a: the line ends here");
  EXPECT_EQ(parse_error(text + "2 1 32768\n"),
            "a.ply: face 0: a: expected a number of type short, got '32768'");
  EXPECT_EQ(parse_error(text + "1 1 1\n"),
            "a.ply: face 0: the line has more numbers than properties");
}

/// A binary file whose `vertex` has the lists of `before` in front, and bytes for one row.
std::string binary_file(const std::string& before, const std::string& row_begin,
                        std::size_t row_bytes = 14 * sizeof(float)) {
  std::string text = replace(kHeader, "ascii", "binary_little_endian");
  text = replace(text, "vertex 2\n", "vertex 1\n" + before);
  return text + row_begin + std::string(row_bytes, '\0');
}

TEST(Ply, SaysWhatIsWrongWithBinaryRows) {
  EXPECT_EQ(parse_error(binary_file("", "")), "nothing was thrown");
  EXPECT_EQ(parse_error(binary_file("", "", 55)),
            "a.ply: header line 3: element 'vertex' of 1 rows, each of 56 bytes or more, but only "
            "55 bytes follow the header");
  EXPECT_EQ(parse_error(binary_file("", "", 57)), "a.ply: 1 bytes follow the last row");
  const std::string list = "property list int double a\n";
  EXPECT_EQ(parse_error(binary_file(list, std::string("\2\0\0\0", 4), 16 + 56)),
            "nothing was thrown");
  EXPECT_EQ(parse_error(binary_file(list, std::string("\2\0\0\0", 4), 16 + 55)),
            "a.ply: vertex 0: rot_3: the file ends here");
  EXPECT_EQ(parse_error(binary_file(list, "\xff\xff\xff\xff")),
            "a.ply: vertex 0: a: a list cannot have the length -1");
  EXPECT_EQ(parse_error(binary_file(list, "\xff\xff\xff\x7f")),
            "a.ply: vertex 0: a: a list of 2147483647 numbers goes beyond the end of the file");
  // Lists of an element before take the bytes that the header's rows count on.
  const std::string faces = replace(kHeader, "format ascii 1.0\n",
                                    "format binary_little_endian 1.0\nelement face 1\nproperty "
                                    "list uchar char a\n");
  EXPECT_EQ(parse_error(faces + '\4' + std::string(2 * 56, '\0')),
            "a.ply: vertex 1: the file ends in this row");
}

TEST_F(PlyFile, NumberThatIsNotFiniteIsNamed) {
  GaussianMap map = random_map(3000, 4);
  write_ply(map.view(), nullptr, path());
  const std::string good = contents();
  const std::size_t row_bytes = 26 * sizeof(float);
  const float bad = -std::numeric_limits<float>::infinity();
  for (std::size_t row : {0u, 2519u, 2520u, 2999u}) {  // Blocks end after 2520 rows.
    std::string bytes = good;
    std::memcpy(bytes.data() + bytes.size() - (3000 - row) * row_bytes + 17 * sizeof(float), &bad,
                sizeof(bad));
    create(bytes);
    EXPECT_EQ(error_of([&] { read_ply(path()); }),
              path() + ": vertex " + std::to_string(row) +
                  ": f_rest_8: expected a finite float, got -inf");
  }
}

TEST_F(PlyFile, WhatCannotBeOpenedIsNamed) {
  EXPECT_EQ(error_of([&] { read_ply(path()); }), path() + ": No such file or directory");
  EXPECT_EQ(error_of([&] { read_ply(folder_.string()); }), folder_.string() + ": Is a directory");
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(error_of([&] { read_ply(path("pipe")); }), path("pipe") + ": Operation not supported");
  EXPECT_THROW(read_ply("/dev/zero"), std::system_error);
}

}  // namespace
}  // namespace gslts::io
