#pragma once

#include <stdexcept>
#include <string>

namespace gslts::python {

/// Marks an object that works without the GIL as used for the lifetime of this one, which is made
/// and destroyed with the GIL held.
/// @throws std::runtime_error  if another thread uses the object.
class ExclusiveUse {
 public:
  /// @param in_use  Mark of the object.
  /// @param type  Name of its class, for the message.
  ExclusiveUse(bool& in_use, const char* type) : in_use_(in_use) {
    if (in_use_) {
      throw std::runtime_error(std::string(type) +
                               ": in use by another thread; each thread needs its own");
    }
    in_use_ = true;
  }
  ~ExclusiveUse() { in_use_ = false; }
  ExclusiveUse(const ExclusiveUse&) = delete;
  ExclusiveUse& operator=(const ExclusiveUse&) = delete;

 private:
  bool& in_use_;
};

}  // namespace gslts::python
