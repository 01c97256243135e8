#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <limits>
#include <string>

#include "gslts/io/ply.hpp"
#include "ply_files.hpp"

namespace gslts::io {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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
