#include "ply_rows.hpp"

#include <algorithm>

namespace gslts::io {
namespace {

/// Longer than any number that a program prints: the largest double has 309 digits before the
/// point.
constexpr std::size_t kMaxNumberBytes = 1000;

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r'; }

}  // namespace

/// A value of a row, to be named in messages.
struct RowReader::Place {
  const Element& element;
  std::uint64_t row;
  const Property& property;
};

std::size_t packed_row_bytes(const Element& element) {
  std::size_t bytes = 0;
  for (const Property& property : element.properties) {
    if (!property.length_type) bytes += size_of(property.type);
  }
  return bytes;
}

PackedRows RowReader::read(const Element& element, std::uint64_t row) {
  const bool has_lists =
      std::any_of(element.properties.begin(), element.properties.end(),
                  [](const Property& property) { return property.length_type.has_value(); });
  if (format_ != Format::kAscii && !has_lists) return read_block(element, row);
  packed_.clear();
  for (const Property& property : element.properties) {
    const Place place{element, row, property};
    if (format_ == Format::kAscii) {
      read_text(place);
    } else {
      read_binary(place);
    }
  }
  if (format_ == Format::kAscii) end_line(element, row);
  return {packed_.data(), 1};
}

/// The rows lie packed in the file: takes as many as there are in memory.
PackedRows RowReader::read_block(const Element& element, std::uint64_t row) {
  // A property is longer in the header than in a row, so a row fits into a block.
  const std::size_t row_bytes = packed_row_bytes(element);
  const std::string_view bytes = input_.ahead(row_bytes);
  const std::uint64_t count = std::min<std::uint64_t>(
      element.rows - row, std::min(bytes.size(), Input::kBlockBytes) / row_bytes);
  if (count == 0) {
    input_.fail(element.name + " " + std::to_string(row) + ": the file ends in this row");
  }
  input_.skip(count * row_bytes);
  return {bytes.data(), static_cast<std::size_t>(count)};
}

void RowReader::end() {
  if (format_ == Format::kAscii) {
    for (auto text = skip_spaces(); !text.empty() && text[0] == '\n'; text = skip_spaces()) {
      input_.skip(1);
    }
  }
  if (input_.remaining() > 0) {
    input_.fail(std::to_string(input_.remaining()) + " bytes follow the last row");
  }
}

/// Reads a number or list from the line.
void RowReader::read_text(const Place& place) {
  const auto next = [&](Scalar type, auto value) {
    const std::string_view word = next_word(place);
    if (!parse_number(word, value)) {
      fail(place, "expected a number of type " + name_of(type) + ", got " + quoted(word));
    }
    return value;
  };
  const Property& property = place.property;
  if (!property.length_type) {
    with_zero_of(property.type, [&](auto zero) {
      const auto value = next(property.type, zero);
      const char* const bytes = reinterpret_cast<const char*>(&value);
      packed_.insert(packed_.end(), bytes, bytes + sizeof(value));
    });
    return;
  }
  const std::int64_t length = with_zero_of(*property.length_type, [&](auto zero) {
    return static_cast<std::int64_t>(next(*property.length_type, zero));
  });
  if (length < 0) fail(place, "a list cannot have the length " + std::to_string(length));
  // However great the length is, the line ends.
  for (std::int64_t i = 0; i < length; ++i) {
    with_zero_of(property.type, [&](auto zero) { next(property.type, zero); });
  }
}

/// Passes over spaces. Returns the bytes to come: more than kMaxNumberBytes, fewer only before the
/// end of the file.
std::string_view RowReader::skip_spaces() {
  for (;;) {
    const std::string_view text = input_.ahead(kMaxNumberBytes + 1);
    const auto end = std::find_if_not(text.begin(), text.end(), is_space);
    if (end == text.begin()) return text;
    input_.skip(static_cast<std::uint64_t>(end - text.begin()));
  }
}

/// The next word on the line.
std::string_view RowReader::next_word(const Place& place) {
  const std::string_view text = skip_spaces();
  const auto ends_word = [](char c) { return is_space(c) || c == '\n'; };
  const auto end = std::find_if(text.begin(), text.end(), ends_word);
  const std::string_view word = text.substr(0, static_cast<std::size_t>(end - text.begin()));
  if (word.empty()) fail(place, text.empty() ? "the file ends here" : "the line ends here");
  if (word.size() > kMaxNumberBytes) fail(place, "expected a number, got " + quoted(word));
  input_.skip(word.size());
  return word;
}

void RowReader::end_line(const Element& element, std::uint64_t row) {
  const std::string_view text = skip_spaces();
  if (text.empty()) return;  // The last line may go without.
  if (text[0] != '\n') {
    input_.fail(element.name + " " + std::to_string(row) +
                ": the line has more numbers than properties");
  }
  input_.skip(1);
}

void RowReader::read_binary(const Place& place) {
  const auto next = [&](Scalar type) {
    const std::size_t size = size_of(type);
    const std::string_view bytes = input_.ahead(size);
    if (bytes.size() < size) fail(place, "the file ends here");
    input_.skip(size);
    return bytes.data();
  };
  const Property& property = place.property;
  if (!property.length_type) {
    const char* const bytes = next(property.type);
    packed_.insert(packed_.end(), bytes, bytes + size_of(property.type));
    return;
  }
  const char* const bytes = next(*property.length_type);
  const std::int64_t length = with_zero_of(*property.length_type, [&](auto zero) {
    return static_cast<std::int64_t>(load<decltype(zero)>(bytes, format_ == Format::kBigEndian));
  });
  if (length < 0) fail(place, "a list cannot have the length " + std::to_string(length));
  const std::uint64_t size = size_of(property.type);
  if (static_cast<std::uint64_t>(length) > input_.remaining() / size) {
    fail(place, "a list of " + std::to_string(length) + " numbers goes beyond the end of the file");
  }
  input_.skip(static_cast<std::uint64_t>(length) * size);
}

void RowReader::fail(const Place& place, const std::string& what) const {
  input_.fail(place.element.name + " " + std::to_string(place.row) + ": " + place.property.name +
              ": " + what);
}

}  // namespace gslts::io
