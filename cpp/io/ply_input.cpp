#include "ply_input.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace gslts::io {

Input::Input(std::string_view bytes, const std::string& name) : name_(name), window_(bytes) {}

Input::Input(const std::string& path) : name_(path) {
  // Without O_NONBLOCK, opening a named pipe would wait for a writer.
  file_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file_ < 0) fail_with(errno);
  struct stat status = {};
  int error = 0;
  if (::fstat(file_, &status) != 0) {
    error = errno;
  } else if (!S_ISREG(status.st_mode)) {
    error = S_ISDIR(status.st_mode) ? EISDIR : ENOTSUP;
  }
  if (error != 0) {
    ::close(file_);
    fail_with(error);
  }
  size_ = unread_ = static_cast<std::uint64_t>(status.st_size);
  buffer_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kBlockBytes, size_)));
}

Input::~Input() {
  if (file_ >= 0) ::close(file_);
}

std::string_view Input::ahead(std::size_t wanted) {
  assert(wanted <= kBlockBytes);
  if (window_.size() >= wanted || unread_ == 0) return window_;
  std::copy(window_.begin(), window_.end(), buffer_.begin());
  std::size_t filled = window_.size();
  while (filled < buffer_.size() && unread_ > 0) {
    const std::size_t n =
        static_cast<std::size_t>(std::min<std::uint64_t>(buffer_.size() - filled, unread_));
    const ::ssize_t got =
        ::pread(file_, buffer_.data() + filled, n, static_cast<::off_t>(size_ - unread_));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_with(errno);
    if (got == 0) fail("the file became shorter while it was read");
    filled += static_cast<std::size_t>(got);
    unread_ -= static_cast<std::uint64_t>(got);
  }
  window_ = {buffer_.data(), filled};
  return window_;
}

void Input::skip(std::uint64_t n) {
  assert(n <= remaining());
  const std::uint64_t in_window = std::min<std::uint64_t>(n, window_.size());
  window_.remove_prefix(static_cast<std::size_t>(in_window));
  unread_ -= n - in_window;
}

void Input::fail(const std::string& what) const { throw std::runtime_error(name_ + ": " + what); }

void Input::fail_at_line(std::size_t header_line, const std::string& what) const {
  fail("header line " + std::to_string(header_line) + ": " + what);
}

void Input::fail_with(int error) const {
  throw std::system_error(error, std::generic_category(), name_);
}

}  // namespace gslts::io
