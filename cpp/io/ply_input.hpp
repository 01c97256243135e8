#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace gslts::io {

/// Bytes of a PLY file, in memory or read from the file block by block.
class Input {
 public:
  /// Few system calls, and what was read is in the cache when it is used.
  static constexpr std::size_t kBlockBytes = std::size_t{256} << 10;

  Input(std::string_view bytes, const std::string& name);
  /// @throws std::system_error  naming the path, if it cannot be opened or is no regular file.
  explicit Input(const std::string& path);
  ~Input();
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  /// Returns the next bytes, valid until the next call: `wanted` or more, fewer only at the end.
  /// @param wanted  At most kBlockBytes.
  /// @throws std::system_error  naming the path, if the file cannot be read.
  std::string_view ahead(std::size_t wanted);

  /// Returns the number of bytes that are left.
  std::uint64_t remaining() const { return window_.size() + unread_; }

  /// Skips n bytes, at most `remaining()`.
  void skip(std::uint64_t n);

  /// @throws std::runtime_error  "name: what".
  [[noreturn]] void fail(const std::string& what) const;
  /// @throws std::runtime_error  "name: header line N: what".
  [[noreturn]] void fail_at_line(std::size_t header_line, const std::string& what) const;

 private:
  [[noreturn]] void fail_with(int error) const;

  std::string name_;
  int file_ = -1;
  std::vector<char> buffer_;
  std::string_view window_;   ///< The next bytes that are in memory.
  std::uint64_t unread_ = 0;  ///< Number of bytes of the file after those in the window.
  std::uint64_t size_ = 0;    ///< Size of the file.
};

}  // namespace gslts::io
