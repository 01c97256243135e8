#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "gslts/io/ply.hpp"
#include "ply_header.hpp"
#include "ply_input.hpp"
#include "ply_layout.hpp"

namespace gslts::io {
namespace {

/// A new file that replaces another one when it is complete, and is removed otherwise.
class Replacement {
 public:
  explicit Replacement(const std::string& path) : path_(path), target_(path) {
    struct stat status = {};
    if (::stat(path.c_str(), &status) == 0) {
      if (S_ISDIR(status.st_mode)) fail(EISDIR);
      if (!S_ISREG(status.st_mode)) fail(ENOTSUP);
      std::error_code error;
      target_ = std::filesystem::canonical(path, error);  // The file behind symbolic links.
      if (error) fail(error.value());
    }
    static std::atomic<unsigned> count{0};
    do {
      const std::string name = ".gslts-" + std::to_string(::getpid()) + "-" +
                               std::to_string(count.fetch_add(1)) + ".tmp";
      temporary_ = std::filesystem::path(target_).replace_filename(name);
      file_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (file_ < 0 && errno == EEXIST);
    if (file_ < 0) fail(errno);
  }

  ~Replacement() {
    if (file_ >= 0) ::close(file_);
    if (!done_) ::unlink(temporary_.c_str());
  }
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;

  void write(const char* bytes, std::size_t size) {
    while (size > 0) {
      const ::ssize_t written = ::write(file_, bytes, size);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(errno);
      bytes += written;
      size -= static_cast<std::size_t>(written);
    }
  }

  void finish() {
    if (::fsync(file_) != 0) fail(errno);
    if (::close(std::exchange(file_, -1)) != 0) fail(errno);
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail(errno);
    done_ = true;
  }

 private:
  [[noreturn]] void fail(int error) const {
    throw std::system_error(error, std::generic_category(), path_);
  }

  std::string path_;
  std::filesystem::path target_, temporary_;
  int file_ = -1;
  bool done_ = false;
};

/// Number of columns before nx ny nz.
constexpr std::size_t kPositions = 3;
/// Bytes of nx ny nz, which are 0.
constexpr std::size_t kNormalsBytes = 3 * sizeof(float);

std::string header_of(const GaussianView<float>& gaussians,
                      const std::vector<Column<const float>>& columns, bool with_ids) {
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  const Eigen::Vector3d& origin = gaussians.origin;
  // Even the sign of a zero comes back.
  const bool default_origin = std::all_of(origin.begin(), origin.end(),
                                          [](double x) { return x == 0 && !std::signbit(x); });
  if (!default_origin) {
    header += "comment gslts origin";
    for (double x : origin) {
      char text[32];
      header += ' ';
      header.append(text, std::to_chars(text, text + sizeof(text), x).ptr);
    }
    header += '\n';
  }
  header += "element vertex " + std::to_string(gaussians.size) + '\n';
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (i == kPositions) header += "property float nx\nproperty float ny\nproperty float nz\n";
    header += "property float " + columns[i].property + '\n';
  }
  if (with_ids) header += "property uint id_low\nproperty uint id_high\n";
  return header + "end_header\n";
}

void write_rows(std::size_t size, const std::vector<Column<const float>>& columns,
                const std::uint64_t* ids, Replacement& file) {
  const std::size_t ids_offset = columns.size() * sizeof(float) + kNormalsBytes;
  const std::size_t row_bytes = ids_offset + (ids ? sizeof(*ids) : 0);
  const std::size_t block_rows = std::max<std::size_t>(1, Input::kBlockBytes / row_bytes);
  std::vector<char> block(block_rows * row_bytes);  // The normals stay zero.
  for (std::size_t begin = 0; begin < size; begin += block_rows) {
    const std::size_t rows = std::min(block_rows, size - begin);
    for (std::size_t column = 0; column < columns.size(); ++column) {
      const auto& [name, first, stride] = columns[column];
      char* const to =
          block.data() + column * sizeof(float) + (column < kPositions ? 0 : kNormalsBytes);
      for (std::size_t i = 0; i < rows; ++i) {
        std::memcpy(to + i * row_bytes, first + (begin + i) * stride, sizeof(float));
      }
    }
    for (std::size_t i = 0; ids && i < rows; ++i) {
      std::memcpy(block.data() + i * row_bytes + ids_offset, ids + begin + i, sizeof(*ids));
    }
    file.write(block.data(), rows * row_bytes);
  }
}

/// Returns true if the ids are 0, 1, ..., as in a file without ids.
bool are_default(const std::uint64_t* ids, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    if (ids[i] != i) return false;
  }
  return true;
}

}  // namespace

void write_ply(const GaussianView<float>& gaussians, const std::uint64_t* ids,
               const std::string& path) {
  validate(gaussians, "write_ply");
  require_finite(gaussians, "write_ply");
  if (ids && are_default(ids, gaussians.size)) ids = nullptr;
  if (const auto id = ids ? repeated_id(ids, gaussians.size) : std::nullopt) {
    throw std::invalid_argument("write_ply: ids: " + std::to_string(*id) +
                                " occurs more than once");
  }
  const auto columns = columns_of<const float>(gaussians);
  const std::string header = header_of(gaussians, columns, ids != nullptr);
  if (header.size() > kMaxHeaderBytes) {
    throw std::invalid_argument(
        "write_ply: feature_dims: " + std::to_string(gaussians.feature_dims) +
        " names do not fit into a header");
  }
  Replacement file(path);
  file.write(header.data(), header.size());
  write_rows(gaussians.size, columns, ids, file);
  file.finish();
}

}  // namespace gslts::io
