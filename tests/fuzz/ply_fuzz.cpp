// Fuzz target: whatever the bytes are, reading them as PLY gives a sound map or one line of error.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include "gslts/io/ply.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  std::string error;
  try {
    const gslts::io::PlyContents contents = gslts::io::parse_ply(bytes, "input");
    // Every other exception ends the process, and that is a finding.
    gslts::require_finite(contents.map.view(), "ply_fuzz");
    require(contents.map.origin.allFinite());
    require(contents.map.ids.size() == contents.map.size());
    return 0;
  } catch (const std::runtime_error& exception) {
    error = exception.what();
  }
  require(error.rfind("input: ", 0) == 0 && error.size() < 1000);
  for (char c : error) require(c >= ' ' && c <= '~');
  return 0;
}
