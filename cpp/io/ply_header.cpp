#include "ply_header.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

namespace gslts::io {
namespace {

/// The first name of a type is that of messages.
constexpr std::pair<std::string_view, Scalar> kScalars[] = {
    {"char", Scalar::kInt8},      {"int8", Scalar::kInt8},       {"uchar", Scalar::kUint8},
    {"uint8", Scalar::kUint8},    {"short", Scalar::kInt16},     {"int16", Scalar::kInt16},
    {"ushort", Scalar::kUint16},  {"uint16", Scalar::kUint16},   {"int", Scalar::kInt32},
    {"int32", Scalar::kInt32},    {"uint", Scalar::kUint32},     {"uint32", Scalar::kUint32},
    {"float", Scalar::kFloat32},  {"float32", Scalar::kFloat32}, {"double", Scalar::kFloat64},
    {"float64", Scalar::kFloat64}};

/// Formats by their name in the header.
constexpr std::pair<std::string_view, Format> kFormats[] = {
    {"ascii", Format::kAscii},
    {"binary_little_endian", Format::kLittleEndian},
    {"binary_big_endian", Format::kBigEndian}};

/// Maximum length of a line other than a comment: bounds names, and with them messages.
constexpr std::size_t kMaxLineBytes = 256;

bool is_printable(char c) { return c >= ' ' && c <= '~'; }

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kSpace = " \t";
  std::vector<std::string_view> words;
  for (std::size_t begin = line.find_first_not_of(kSpace); begin != line.npos;) {
    const std::size_t end = std::min(line.find_first_of(kSpace, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kSpace, end);
  }
  return words;
}

/// Parses a header line by line.
class HeaderParser {
 public:
  explicit HeaderParser(Input& input)
      : input_(input), rest_(input.ahead(kMaxHeaderBytes).substr(0, kMaxHeaderBytes)) {}

  Header parse() {
    const std::size_t available = rest_.size();
    if (rest_.substr(0, 3) != "ply") input_.fail("no PLY file: it does not begin with 'ply'");
    next_line();
    if (text_ != "ply") fail("expected 'ply', got " + quoted(text_));
    while (parse_next_line()) {
    }
    if (!format_) fail("the header has no format");
    input_.skip(available - rest_.size());
    require_rows_fit();
    return {*format_, std::move(elements_), origin_};
  }

 private:
  void next_line() {
    ++line_;
    const std::size_t end = rest_.find('\n');
    if (end == rest_.npos) {
      fail(input_.remaining() > kMaxHeaderBytes
               ? "the header does not end within " + std::to_string(kMaxHeaderBytes) + " bytes"
               : "the file ends before end_header");
    }
    text_ = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    if (!text_.empty() && text_.back() == '\r') text_.remove_suffix(1);
    words_ = words_of(text_);
  }

  /// Returns false at the end of the header.
  bool parse_next_line() {
    next_line();
    const std::string_view keyword = words_.empty() ? "" : words_[0];
    if (keyword == "comment") {
      parse_comment();
    } else if (keyword == "obj_info") {
      // Free text.
    } else if (text_.size() > kMaxLineBytes) {
      fail("longer than " + std::to_string(kMaxLineBytes) + " bytes: " + quoted(text_));
    } else if (!std::all_of(text_.begin(), text_.end(),
                            [](char c) { return is_printable(c) || c == '\t'; })) {
      fail("unprintable character in " + quoted(text_));
    } else if (keyword == "format") {
      parse_format();
    } else if (keyword == "element") {
      parse_element();
    } else if (keyword == "property") {
      parse_property();
    } else if (keyword != "end_header" || words_.size() != 1) {
      fail("expected format, element, property, comment or end_header, got " + quoted(text_));
    } else {
      return false;
    }
    return true;
  }

  void parse_comment() {
    if (words_.size() < 3 || words_[1] != "gslts" || words_[2] != "origin") return;
    if (origin_) fail("second origin");
    origin_.emplace();
    bool good = words_.size() == 6;
    for (std::size_t i = 0; good && i < 3; ++i) {
      double& x = (*origin_)(static_cast<Eigen::Index>(i));
      good = parse_number(words_[3 + i], x) && std::isfinite(x);
    }
    if (!good) fail("expected comment gslts origin X Y Z with finite numbers");
  }

  void parse_format() {
    if (format_) fail("second format");
    const auto known = std::find_if(std::begin(kFormats), std::end(kFormats), [&](auto& format) {
      return words_.size() == 3 && words_[1] == format.first && words_[2] == "1.0";
    });
    if (known == std::end(kFormats)) {
      fail("expected format ascii, binary_little_endian or binary_big_endian 1.0, got " +
           quoted(text_));
    }
    format_ = known->second;
  }

  void parse_element() {
    if (words_.size() != 3) fail("expected element NAME ROWS, got " + quoted(text_));
    if (!element_names_.insert(words_[1]).second) fail("second element " + quoted(words_[1]));
    std::uint64_t rows = 0;
    if (!parse_number(words_[2], rows)) {
      fail("the number of rows must be an integer from 0 to 2^64 - 1, got " + quoted(words_[2]));
    }
    property_names_.clear();
    elements_.push_back({std::string(words_[1]), rows, {}, line_});
  }

  void parse_property() {
    if (elements_.empty()) fail("property before the first element");
    const bool is_list = words_.size() == 5 && words_[1] == "list";
    if (!is_list && words_.size() != 3) {
      fail("expected property TYPE NAME or property list TYPE TYPE NAME, got " + quoted(text_));
    }
    const std::string_view name = words_.back();
    if (!property_names_.insert(name).second) fail("second property " + quoted(name));
    Property property{std::string(name), parse_type(words_[words_.size() - 2]), {}, line_};
    if (is_list) {
      property.length_type = parse_type(words_[2]);
      if (*property.length_type == Scalar::kFloat32 || *property.length_type == Scalar::kFloat64) {
        fail("the length of a list must be an integer, got " + quoted(words_[2]));
      }
    }
    elements_.back().properties.push_back(std::move(property));
  }

  Scalar parse_type(std::string_view word) const {
    const auto known = std::find_if(std::begin(kScalars), std::end(kScalars),
                                    [&](auto& scalar) { return word == scalar.first; });
    if (known == std::end(kScalars)) fail("unknown type " + quoted(word));
    return known->second;
  }

  /// Checks that the file is long enough for all rows, so that a wrong count leads to no
  /// allocation.
  void require_rows_fit() const {
    // In ascii a number takes a digit and a space or a line's end, which the last may lack.
    const bool ascii = *format_ == Format::kAscii;
    std::uint64_t available = input_.remaining() + (ascii ? 1 : 0);
    for (const Element& element : elements_) {
      std::uint64_t row_bytes = 0;
      for (const Property& property : element.properties) {
        row_bytes += ascii ? 2 : size_of(property.length_type.value_or(property.type));
      }
      if (element.rows > 0 && row_bytes == 0) {
        input_.fail_at_line(element.line,
                            "element " + quoted(element.name) + " has rows but no properties");
      }
      if (element.rows > 0 && element.rows > available / row_bytes) {
        input_.fail_at_line(element.line,
                            "element " + quoted(element.name) + " of " +
                                std::to_string(element.rows) + " rows, each of " +
                                std::to_string(row_bytes) + " bytes or more, but only " +
                                std::to_string(input_.remaining()) + " bytes follow the header");
      }
      available -= element.rows * row_bytes;
    }
  }

  [[noreturn]] void fail(const std::string& what) const { input_.fail_at_line(line_, what); }

  Input& input_;
  std::string_view rest_;  // Of the block that begins with the header.
  // The current line: its number, its text without what ends it, and the words of that.
  std::size_t line_ = 0;
  std::string_view text_;
  std::vector<std::string_view> words_;
  std::optional<Format> format_;
  std::optional<Eigen::Vector3d> origin_;
  std::vector<Element> elements_;
  std::set<std::string_view> element_names_, property_names_;  // Properties: of the last element.
};

}  // namespace

Header read_header(Input& input) { return HeaderParser(input).parse(); }

std::string name_of(Scalar type) {
  return std::string(std::find_if(std::begin(kScalars), std::end(kScalars), [&](auto& scalar) {
                       return scalar.second == type;
                     })->first);
}

std::string quoted(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::string result = "'";
  for (char c : text.substr(0, kLongest)) result += is_printable(c) ? c : '?';
  return result + (text.size() > kLongest ? "...'" : "'");
}

}  // namespace gslts::io
