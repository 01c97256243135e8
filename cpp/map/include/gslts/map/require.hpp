#pragma once

#include <sstream>
#include <stdexcept>

namespace gslts {

/// Throws the error of a bad argument: "function: what, got value".
/// @param function  Name of the public entry that was called.
/// @param what  The argument and its rule, such as "width must be in 1..65536".
/// @throws std::invalid_argument  always.
template <typename Value>
[[noreturn]] void fail(const char* function, const char* what, const Value& value) {
  std::ostringstream message;
  message << function << ": " << what << ", got " << value;
  throw std::invalid_argument(message.str());
}

/// Checks an argument of a public entry.
/// @throws std::invalid_argument  if the rule does not hold; see `fail`.
template <typename Value>
void require(bool holds, const char* function, const char* what, const Value& value) {
  if (!holds) fail(function, what, value);
}

}  // namespace gslts
