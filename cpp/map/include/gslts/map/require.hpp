#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <stdexcept>
#include <string>

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

/// Checks that points [count,3] are finite.
/// @throws std::invalid_argument  naming the first point that is not.
inline void require_finite_points(const char* function, const char* name, const float* points,
                                  std::size_t count) {
  const float* end = points + 3 * count;
  const float* bad = std::find_if(points, end, [](float x) { return !std::isfinite(x); });
  if (bad == end) return;
  throw std::invalid_argument(std::string(function) + ": " + name + "[" +
                              std::to_string((bad - points) / 3) + "] is not finite");
}

}  // namespace gslts
