#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "target.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include "gslts/simd/target.hpp"

#include <cstdint>
#include <cstdlib>
#include <stdexcept>

HWY_BEFORE_NAMESPACE();
namespace gslts::simd::HWY_NAMESPACE {

std::int64_t target_bit() { return HWY_TARGET; }

}  // namespace gslts::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::simd {
namespace {

HWY_EXPORT(target_bit);

struct Target {
  const char* name;
  std::int64_t bit;  ///< Highway's.
};
/// Instruction sets by the names that `GSLTS_SIMD` takes.
constexpr Target kTargets[] = {
    {"avx512", HWY_AVX3}, {"avx2", HWY_AVX2}, {"sse4", HWY_SSE4}, {"neon", HWY_NEON}};

std::int64_t usable_targets() {
  static const std::int64_t usable = HWY_SUPPORTED_TARGETS & HWY_TARGETS;
  return usable;
}

/// @param source  Where the name was given, for the message.
void restrict_to(const std::string& name, const std::string& source) {
  std::string names;
  for (const Target& target : kTargets) {
    if (!(target.bit & usable_targets())) continue;
    if (name == target.name) {
#if (HWY_TARGETS & (HWY_TARGETS - 1)) != 0
      hwy::SetSupportedTargetsForTest(target.bit);
#endif
      return;
    }
    names += (names.empty() ? "" : ", ") + std::string(target.name);
  }
  throw std::invalid_argument(source + " is \"" + name + "\", but this machine can use " + names);
}

}  // namespace

void apply_environment() {
  static const bool applied = [] {
    usable_targets();  // Before they are restricted.
    const char* name = std::getenv("GSLTS_SIMD");
    if (name && *name) restrict_to(name, "GSLTS_SIMD");
    return true;
  }();
  static_cast<void>(applied);
}

std::string target() {
  apply_environment();
  const std::int64_t used = HWY_DYNAMIC_DISPATCH(target_bit)();
  for (const Target& target : kTargets) {
    if (target.bit == used) return target.name;
  }
  return hwy::TargetName(used);
}

std::vector<std::string> targets() {
  std::vector<std::string> names;
  for (const Target& target : kTargets) {
    if (target.bit & usable_targets()) names.push_back(target.name);
  }
  return names;
}

void use_target(const std::string& name) {
  apply_environment();
  restrict_to(name, "use_target: name");
}

}  // namespace gslts::simd
#endif
