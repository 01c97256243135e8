#pragma once

#include <sstream>
#include <stdexcept>

namespace gslts::detect {

/// @throws std::invalid_argument  unless low <= value <= high.
inline void require_in(const char* function, const char* name, double value, double low,
                       double high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << function << ": " << name << " must be in [" << low << ", " << high << "], got " << value;
  throw std::invalid_argument(text.str());
}

}  // namespace gslts::detect
