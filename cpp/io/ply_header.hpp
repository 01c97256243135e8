#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ply_input.hpp"
#include "ply_scalar.hpp"

namespace gslts::io {

/// Maximum size of a header; about 9,000 properties fit in.
constexpr std::size_t kMaxHeaderBytes = Input::kBlockBytes;

enum class Format { kAscii, kLittleEndian, kBigEndian };

/// A number in each row of an element, or a list of them.
struct Property {
  std::string name;
  Scalar type;                        ///< Type of the number, or of those in the list.
  std::optional<Scalar> length_type;  ///< Type of a list's length, an integer; none for a number.
  std::size_t line;                   ///< Line of the header that declares it, from 1.
};

struct Element {
  std::string name;
  std::uint64_t rows;
  std::vector<Property> properties;
  std::size_t line;
};

struct Header {
  Format format;
  std::vector<Element> elements;
  std::optional<Eigen::Vector3d> origin;  ///< Origin from the comment `gslts origin`.
};

/// Reads the header and leaves the input at the first byte after it. Names are printable ASCII and
/// unique, and the rest of the input is long enough for the rows of all elements, their lists
/// empty.
/// @throws std::runtime_error  naming the line.
Header read_header(Input& input);

/// Returns the name of a type in PLY files.
std::string name_of(Scalar type);

/// Quotes text of the file for a message: short and printable.
std::string quoted(std::string_view text);

}  // namespace gslts::io
