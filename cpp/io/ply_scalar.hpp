#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>

namespace gslts::io {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "PLY files are read and written as such");

/// The types of numbers in PLY files.
enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

/// Calls `function` with a zero of the C++ type that `type` stands for.
template <typename Function>
auto with_zero_of(Scalar type, Function function) {
  switch (type) {
    case Scalar::kInt8:
      return function(std::int8_t{});
    case Scalar::kUint8:
      return function(std::uint8_t{});
    case Scalar::kInt16:
      return function(std::int16_t{});
    case Scalar::kUint16:
      return function(std::uint16_t{});
    case Scalar::kInt32:
      return function(std::int32_t{});
    case Scalar::kUint32:
      return function(std::uint32_t{});
    case Scalar::kFloat32:
      return function(float{});
    case Scalar::kFloat64:
      break;
  }
  return function(double{});
}

inline std::size_t size_of(Scalar type) {
  return with_zero_of(type, [](auto zero) { return sizeof(zero); });
}

/// Loads a number from sizeof(T) bytes at any address, in little-endian or `big_endian` order.
template <typename T>
T load(const char* bytes, bool big_endian) {
  char ordered[sizeof(T)];
  std::memcpy(ordered, bytes, sizeof(T));
  if (big_endian) std::reverse(ordered, ordered + sizeof(T));
  T value;
  std::memcpy(&value, ordered, sizeof(T));
  return value;
}

/// Parses a number of type T; returns false if `word` is none. A float is read as double first, so
/// that a number too small for a float becomes 0, as in other readers.
template <typename T>
bool parse_number(std::string_view word, T& value) {
  std::conditional_t<std::is_same_v<T, float>, double, T> number = 0;
  // from_chars knows no plus sign.
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* const end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, number);
  if (result.ec != std::errc() || result.ptr != end) return false;
  value = static_cast<T>(number);
  return true;
}

}  // namespace gslts::io
