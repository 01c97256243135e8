#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "ply_header.hpp"
#include "ply_input.hpp"

namespace gslts::io {

/// Rows of an element: their numbers without padding, in the order of the properties and without
/// the lists. Those from binary files are in the byte order of the file, others in that of the
/// host.
struct PackedRows {
  const char* first;
  std::size_t count;
};

/// Size of a packed row.
std::size_t packed_row_bytes(const Element& element);

/// Reads the rows of the elements, which follow the header, in their order.
class RowReader {
 public:
  RowReader(Input& input, Format format) : input_(input), format_(format) {}

  /// Reads at least one row, from number `row` < element.rows on; the rows are valid until the next
  /// call.
  /// @throws std::runtime_error  naming the row and the property.
  PackedRows read(const Element& element, std::uint64_t row);

  /// @throws std::runtime_error  if something follows the last row.
  void end();

 private:
  struct Place;

  PackedRows read_block(const Element& element, std::uint64_t row);
  void read_text(const Place& place);
  void read_binary(const Place& place);
  void end_line(const Element& element, std::uint64_t row);
  std::string_view skip_spaces();
  std::string_view next_word(const Place& place);
  [[noreturn]] void fail(const Place& place, const std::string& what) const;

  Input& input_;
  Format format_;
  std::vector<char> packed_;  // A row that does not lie so in the file.
};

}  // namespace gslts::io
