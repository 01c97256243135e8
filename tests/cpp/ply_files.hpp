/// Maps, PLY files and error messages for the tests of the PLY format.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "gslts/io/ply.hpp"

namespace gslts::io {

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing was thrown";
}

inline std::string parse_error(const std::string& bytes) {
  return error_of([&] { parse_ply(bytes, "a.ply"); });
}

template <typename T>
std::string bytes_of(const Array<T>& array) {
  return std::string(reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T));
}

/// Expects that two maps have the same bits.
inline void expect_same(const GaussianMap& a, const GaussianMap& b) {
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
inline GaussianMap random_map(std::size_t size, int sh_bases, int feature_dims = 0) {
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

inline constexpr char kHeader[] =
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
inline const std::string kText = std::string(kHeader) +
                                 "1 2 3 4 5 6 7 8 9 10 11 12 13 14\n"
                                 "-1 -2 -3 -4 -5 -6 -7 -8 -9 -10 -11 -12 -13 -14\n";

/// The text with the first `before` in it replaced.
inline std::string replace(std::string text, const std::string& before, const std::string& after) {
  const std::size_t begin = text.find(before);
  EXPECT_NE(begin, text.npos) << before;
  return text.replace(begin, before.size(), after);
}

inline std::string repeat(const std::string& text, int times) {
  std::string result;
  for (int i = 0; i < times; ++i) result += text;
  return result;
}

/// `count` properties prefix0, prefix1, ...
inline std::string numbered(const std::string& prefix, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += "property float " + prefix + std::to_string(i) + '\n';
  return result;
}

/// The map of `kText`.
inline void expect_text_map(const GaussianMap& map) {
  EXPECT_THAT(map.means, testing::ElementsAre(1, 2, 3, -1, -2, -3));
  EXPECT_THAT(map.sh, testing::ElementsAre(4, 5, 6, -4, -5, -6));
  EXPECT_THAT(map.logit_opacities, testing::ElementsAre(7, -7));
  EXPECT_THAT(map.log_scales, testing::ElementsAre(8, 9, 10, -8, -9, -10));
  EXPECT_THAT(map.quats, testing::ElementsAre(11, 12, 13, 14, -11, -12, -13, -14));
  EXPECT_THAT(map.ids, testing::ElementsAre(0, 1));
  EXPECT_EQ(map.sh_bases, 1);
  EXPECT_EQ(map.feature_dims, 0);
  EXPECT_EQ(map.origin, Eigen::Vector3d::Zero());
}

}  // namespace gslts::io
