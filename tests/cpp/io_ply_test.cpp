#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <system_error>

#include "gslts/io/ply.hpp"

namespace gslts::io {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing was thrown";
}

std::string parse_error(const std::string& bytes) {
  return error_of([&] { parse_ply(bytes, "a.ply"); });
}

template <typename T>
std::string bytes_of(const Array<T>& array) {
  return std::string(reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T));
}

/// Expects that two maps have the same bits.
void expect_same(const GaussianMap& a, const GaussianMap& b) {
  EXPECT_EQ(a.sh_bases, b.sh_bases);
  EXPECT_EQ(a.feature_dims, b.feature_dims);
  EXPECT_EQ(std::memcmp(a.origin.data(), b.origin.data(), 3 * sizeof(double)), 0);
  EXPECT_EQ(bytes_of(a.means), bytes_of(b.means));
  EXPECT_EQ(bytes_of(a.quats), bytes_of(b.quats));
  EXPECT_EQ(bytes_of(a.log_scales), bytes_of(b.log_scales));
  EXPECT_EQ(bytes_of(a.logit_opacities), bytes_of(b.logit_opacities));
  EXPECT_EQ(bytes_of(a.sh), bytes_of(b.sh));
  EXPECT_EQ(bytes_of(a.features), bytes_of(b.features));
  EXPECT_EQ(a.ids, b.ids);
}

/// A map of random bits that are finite floats: of any magnitude, denormal, of either sign.
GaussianMap random_map(std::size_t size, int sh_bases, int feature_dims = 0) {
  GaussianMap map = make_gaussian_map<float>(size, sh_bases, feature_dims);
  std::mt19937 generator(7);
  for (auto* array :
       {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh, &map.features}) {
    for (float& value : *array) {
      do {
        const std::uint32_t bits = static_cast<std::uint32_t>(generator());
        std::memcpy(&value, &bits, sizeof(value));
      } while (!std::isfinite(value));
    }
  }
  return map;
}

/// A folder that is removed with what is in it.
class PlyFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "gslts-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name = "map.ply") const { return (folder_ / name).string(); }

  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  std::string contents(const std::string& name = "map.ply") const {
    std::ifstream file(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  void create(const std::string& bytes, const std::string& name = "map.ply") const {
    std::ofstream(path(name), std::ios::binary) << bytes;
  }

  std::filesystem::path folder_;
};

const char kHeader[] =
    "ply\n"
    "format ascii 1.0\n"
    "element vertex 2\n"
    "property float x\n"
    "property float y\n"
    "property float z\n"
    "property float f_dc_0\n"
    "property float f_dc_1\n"
    "property float f_dc_2\n"
    "property float opacity\n"
    "property float scale_0\n"
    "property float scale_1\n"
    "property float scale_2\n"
    "property float rot_0\n"
    "property float rot_1\n"
    "property float rot_2\n"
    "property float rot_3\n"
    "end_header\n";
const std::string kText = std::string(kHeader) +
                          "1 2 3 4 5 6 7 8 9 10 11 12 13 14\n"
                          "-1 -2 -3 -4 -5 -6 -7 -8 -9 -10 -11 -12 -13 -14\n";

/// The text with the first `before` in it replaced.
std::string replace(std::string text, const std::string& before, const std::string& after) {
  const std::size_t begin = text.find(before);
  EXPECT_NE(begin, text.npos) << before;
  return text.replace(begin, before.size(), after);
}

std::string repeat(const std::string& text, int times) {
  std::string result;
  for (int i = 0; i < times; ++i) result += text;
  return result;
}

/// `count` properties prefix0, prefix1, ...
std::string numbered(const std::string& prefix, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += "property float " + prefix + std::to_string(i) + '\n';
  return result;
}

/// The map of `kText`.
void expect_text_map(const GaussianMap& map) {
  EXPECT_THAT(map.means, ElementsAre(1, 2, 3, -1, -2, -3));
  EXPECT_THAT(map.sh, ElementsAre(4, 5, 6, -4, -5, -6));
  EXPECT_THAT(map.logit_opacities, ElementsAre(7, -7));
  EXPECT_THAT(map.log_scales, ElementsAre(8, 9, 10, -8, -9, -10));
  EXPECT_THAT(map.quats, ElementsAre(11, 12, 13, 14, -11, -12, -13, -14));
  EXPECT_THAT(map.ids, ElementsAre(0, 1));
  EXPECT_EQ(map.sh_bases, 1);
  EXPECT_EQ(map.feature_dims, 0);
  EXPECT_EQ(map.origin, Eigen::Vector3d::Zero());
}

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
      {"-7", "-inf", "vertex 1: opacity: expected a finite float, got -inf"},
      {"-7", "1e39", "vertex 1: opacity: expected a finite float, got inf"},
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

TEST_F(PlyFile, IdThatOccursTwiceIsNamed) {
  const std::string message = "ids: 5 occurs more than once";
  GaussianMap map = random_map(3, 1);
  map.ids = {5, 9, 5};
  EXPECT_EQ(error_of([&] { write_ply(map.view(), map.ids.data(), path()); }),
            "write_ply: " + message);
  EXPECT_THAT(files(), IsEmpty());
  map.ids = {5, 9, 6};
  write_ply(map.view(), map.ids.data(), path());
  std::string bytes = contents();
  bytes[bytes.size() - 8] = 5;
  EXPECT_EQ(parse_error(bytes), "a.ply: " + message);
}

TEST_F(PlyFile, WriteRejectsWhatCouldNotBeReadBack) {
  GaussianMap map = random_map(3, 1);
  map.sh[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error_of([&] { write_ply(map.view(), nullptr, path()); }),
            "write_ply: sh[1,0,1] is nan");
  GaussianView<float> view;
  view.sh_bases = 2;
  EXPECT_THAT(error_of([&] { write_ply(view, nullptr, path()); }),
              HasSubstr("write_ply: sh_bases"));
  const auto features = make_gaussian_map<float>(0, 1, 10000);
  EXPECT_EQ(error_of([&] { write_ply(features.view(), nullptr, path()); }),
            "write_ply: feature_dims: 10000 names do not fit into a header");
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(PlyFile, WhatCannotBeOpenedIsNamed) {
  EXPECT_EQ(error_of([&] { read_ply(path()); }), path() + ": No such file or directory");
  EXPECT_EQ(error_of([&] { read_ply(folder_.string()); }), folder_.string() + ": Is a directory");
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(error_of([&] { read_ply(path("pipe")); }), path("pipe") + ": Operation not supported");
  EXPECT_THROW(read_ply("/dev/zero"), std::system_error);
}

TEST_F(PlyFile, WriteReplacesFilesAndFollowsLinks) {
  create("old");
  std::filesystem::create_symlink("map.ply", path("link.ply"));
  const GaussianMap map = random_map(2, 1);
  write_ply(map.view(), nullptr, path("link.ply"));
  EXPECT_TRUE(std::filesystem::is_symlink(path("link.ply")));
  expect_same(read_ply(path()).map, map);
  EXPECT_THAT(files(), testing::UnorderedElementsAre("map.ply", "link.ply"));
}

TEST_F(PlyFile, WriteWithoutAFolderFails) {
  const GaussianMap map = random_map(2, 1);
  const auto error = [&](const std::string& to) {
    return error_of([&] { write_ply(map.view(), nullptr, to); });
  };
  EXPECT_EQ(error(path("none/map.ply")), path("none/map.ply") + ": No such file or directory");
  EXPECT_EQ(error(folder_.string()), folder_.string() + ": Is a directory");
  EXPECT_EQ(error("/dev/full"), "/dev/full: Operation not supported");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(PlyFile, WriteIntoAReadOnlyFolderFails) {
  create("old");
  ASSERT_EQ(::chmod(folder_.c_str(), 0555), 0);
  const ::uid_t user = ::geteuid();
  // Root may write everywhere.
  ASSERT_EQ(::seteuid(user == 0 ? 65534 : user), 0);
  const std::string error = error_of([&] { write_ply(random_map(2, 1).view(), nullptr, path()); });
  ASSERT_EQ(::seteuid(user), 0);
  ASSERT_EQ(::chmod(folder_.c_str(), 0700), 0);
  EXPECT_EQ(error, path() + ": Permission denied");
  EXPECT_EQ(contents(), "old");
  EXPECT_THAT(files(), ElementsAre("map.ply"));
}

/// As on a full disk, writing fails half-way.
TEST_F(PlyFile, WriteThatFailsLeavesTheOldFile) {
  create("old");
  const GaussianMap map = random_map(5000, 1);
  rlimit limit = {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const rlimit small = {300000, limit.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string error = error_of([&] { write_ply(map.view(), nullptr, path()); });
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(error, path() + ": File too large");
  EXPECT_EQ(contents(), "old");
  EXPECT_THAT(files(), ElementsAre("map.ply"));
}

}  // namespace
}  // namespace gslts::io
