#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "gslts/io/ply.hpp"
#include "ply_compressed.hpp"
#include "ply_header.hpp"
#include "ply_input.hpp"
#include "ply_layout.hpp"
#include "ply_rows.hpp"
#include "ply_values.hpp"

namespace gslts::io {
namespace {

/// A number of the packed rows of `vertex`.
struct Source {
  const Property* property;
  std::size_t offset;  // In a row.
};

/// Reads the numbers of a column as float. Returns whether all are finite.
template <typename Stored>
bool unpack(const char* from, std::size_t row_bytes, std::size_t rows, bool big_endian, float* to,
            std::size_t stride) {
  bool finite = true;
  for (std::size_t i = 0; i < rows; ++i) {
    // A double beyond the range of float becomes infinite.
    const float value = static_cast<float>(load<Stored>(from + i * row_bytes, big_endian));
    finite &= std::isfinite(value);
    to[i * stride] = value;
  }
  return finite;
}

std::string text_of(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof(text), value).ptr};
}

/// Turns the rows of `vertex` into a map.
class MapBuilder {
 public:
  /// @throws std::runtime_error  if the properties do not make a map.
  MapBuilder(const Element& vertex, const Header& header, const Input& input);

  /// Takes the next rows.
  void add(const PackedRows& rows);

  /// The map, after the last row.
  PlyContents finish();

 private:
  int count_numbered(const std::string& prefix) const;
  int sh_bases() const;
  Source take(const std::string& name);
  void take_colors();
  void move_origin();
  void resolve_not_finite(const PackedRows& rows);

  const Input& input_;
  const Element& vertex_;
  const bool big_endian_;
  const std::size_t row_bytes_;
  std::map<std::string, Source> unused_;  // By name.
  std::vector<Source> sources_;           // Of each of the columns.
  std::vector<Source> id_sources_;        // None, or of the low and the high half.
  GaussianMap map_;
  std::vector<Column<float>> columns_;
  Array<double> centers_;    // [N,3] in double of a file without an origin; none otherwise.
  bool has_colors_ = false;  // Instead of coefficients of degree 0.
  std::size_t rows_ = 0;     // Added so far.
};

MapBuilder::MapBuilder(const Element& vertex, const Header& header, const Input& input)
    : input_(input),
      vertex_(vertex),
      big_endian_(header.format == Format::kBigEndian),
      row_bytes_(packed_row_bytes(vertex)) {
  std::size_t offset = 0;
  for (const Property& property : vertex.properties) {
    unused_[property.name] = {&property, offset};
    if (!property.length_type) offset += size_of(property.type);
  }
  const int bases = sh_bases(), feature_dims = count_numbered("feature_");
  // Only a file that has all properties justifies the memory of all arrays.
  GaussianMap empty = make_gaussian_map<float>(0, bases, feature_dims);
  take_colors();
  for (const auto& column : columns_of<float>(empty)) sources_.push_back(take(column.property));
  if (unused_.count("id_low") + unused_.count("id_high") > 0) {
    id_sources_ = {take("id_low"), take("id_high")};
    for (const Source& source : id_sources_) {
      if (source.property->type != Scalar::kUint32) {
        input_.fail_at_line(source.property->line,
                            quoted(source.property->name) + " must be of type uint");
      }
    }
  }
  for (const char* normal : {"nx", "ny", "nz"}) unused_.erase(normal);
  map_ = make_gaussian_map<float>(static_cast<std::size_t>(vertex.rows), bases, feature_dims);
  map_.origin = header.origin.value_or(Eigen::Vector3d::Zero());
  const auto is_double = [](const Source& s) { return s.property->type == Scalar::kFloat64; };
  if (!header.origin && std::all_of(sources_.begin(), sources_.begin() + 3, is_double)) {
    centers_.resize(map_.means.size());
  }
  columns_ = columns_of<float>(map_);
}

/// Number of the properties prefix0, prefix1, ... without a gap.
int MapBuilder::count_numbered(const std::string& prefix) const {
  std::size_t count = 0;
  while (unused_.count(prefix + std::to_string(count)) > 0) ++count;
  for (const auto& [name, source] : unused_) {
    if (name.compare(0, prefix.size(), prefix) != 0) continue;
    std::uint64_t number = 0;
    const char* const end = name.data() + name.size();
    const auto result = std::from_chars(name.data() + prefix.size(), end, number);
    const bool numbered = result.ec == std::errc() && name == prefix + std::to_string(number);
    if (numbered && number >= count) {
      input_.fail_at_line(source.property->line,
                          quoted(name) + " without " + quoted(prefix + std::to_string(count)));
    }
  }
  return static_cast<int>(count);
}

int MapBuilder::sh_bases() const {
  const int rest = count_numbered("f_rest_");
  for (int bases : {1, 4, 9, 16}) {
    if (rest == 3 * (bases - 1)) return bases;
  }
  input_.fail_at_line(vertex_.line, "degrees 0 to 3 have 0, 9, 24 or 45 properties f_rest_, got " +
                                        std::to_string(rest));
}

Source MapBuilder::take(const std::string& name) {
  const auto found = unused_.find(name);
  if (found == unused_.end()) {
    const bool surfel = name == "scale_2" && unused_.count("rot_0") > 0;
    input_.fail_at_line(vertex_.line, "element 'vertex' lacks property " + quoted(name) +
                                          (surfel ? ": 2D Gaussians; only 3D ones are read" : ""));
  }
  const Source source = found->second;
  if (source.property->length_type) {
    input_.fail_at_line(source.property->line, quoted(name) + " must be a number, not a list");
  }
  unused_.erase(found);
  return source;
}

/// Takes colours of 8 bits for the coefficients of degree 0, as Nerfstudio writes them on request.
void MapBuilder::take_colors() {
  const auto red = unused_.find("red");
  has_colors_ = unused_.count("f_dc_0") + unused_.count("f_rest_0") == 0 && red != unused_.end() &&
                red->second.property->type == Scalar::kUint8;
  if (!has_colors_) return;
  int i = 0;
  for (const char* name : {"red", "green", "blue"}) {
    unused_["f_dc_" + std::to_string(i++)] = take(name);
  }
}

void MapBuilder::add(const PackedRows& rows) {
  bool finite = true;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const auto& [property, offset] = sources_[i];
    const auto& column = columns_[i];
    finite &= with_zero_of(property->type, [&, from = rows.first + offset](auto zero) {
      return unpack<decltype(zero)>(from, row_bytes_, rows.count, big_endian_,
                                    column.first + rows_ * column.stride, column.stride);
    });
  }
  if (!finite) resolve_not_finite(rows);
  if (!centers_.empty()) {
    for (std::size_t i = 0; i < 3 * rows.count; ++i) {
      const char* const from = rows.first + i / 3 * row_bytes_ + sources_[i % 3].offset;
      centers_[3 * rows_ + i] = load<double>(from, big_endian_);
    }
  }
  if (has_colors_) {
    for (std::size_t i = 0; i < 3 * rows.count; ++i) {
      float& value = map_.sh[3 * rows_ + i];
      value = static_cast<float>(sh_of_color(value / 255.0));
    }
  }
  if (!id_sources_.empty()) {
    for (std::size_t i = 0; i < rows.count; ++i) {
      const auto half = [&](const Source& source) {
        return load<std::uint32_t>(rows.first + i * row_bytes_ + source.offset, big_endian_);
      };
      map_.ids[rows_ + i] = std::uint64_t{half(id_sources_[1])} << 32 | half(id_sources_[0]);
    }
  }
  rows_ += rows.count;
}

/// Infinity has a meaning in opacities and scales: programs compute the logit of 1 and the
/// logarithm of 0. The first other number among new rows that float does not hold is an error.
void MapBuilder::resolve_not_finite(const PackedRows& rows) {
  for (std::size_t i = 0; i < rows.count; ++i) {
    for (std::size_t j = 0; j < columns_.size(); ++j) {
      const auto& [property, offset] = sources_[j];
      float& stored = columns_[j].first[(rows_ + i) * columns_[j].stride];
      if (std::isfinite(stored)) continue;
      if (property->name == "opacity" && !std::isnan(stored)) {
        stored = stored > 0 ? kOpaqueLogit : -kOpaqueLogit;
      } else if (property->name.rfind("scale_", 0) == 0 && stored < 0) {
        stored = kFlatLogScale;
      } else {
        const double value =
            with_zero_of(property->type, [&, from = rows.first + offset](auto zero) {
              return static_cast<double>(load<decltype(zero)>(from + i * row_bytes_, big_endian_));
            });
        input_.fail("vertex " + std::to_string(rows_ + i) + ": " + property->name +
                    ": expected a finite float, got " + text_of(value));
      }
    }
  }
}

/// Moves the origin to whole metres among centres that float would round, as those of surveys. The
/// median is there whatever outliers a map has.
void MapBuilder::move_origin() {
  Eigen::Vector3d median;
  std::vector<double> axis(map_.size());
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < axis.size(); ++i) axis[i] = centers_[3 * i + k];
    const auto middle = axis.begin() + axis.size() / 2;
    std::nth_element(axis.begin(), middle, axis.end());
    median(Eigen::Index(k)) = std::clamp(std::round(*middle), -kMaxOrigin, kMaxOrigin);
  }
  if (median.cwiseAbs().maxCoeff() < kMinOrigin) return;
  map_.origin = median;
  for (std::size_t i = 0; i < centers_.size(); ++i) {
    map_.means[i] = static_cast<float>(centers_[i] - median(Eigen::Index(i % 3)));
  }
}

PlyContents MapBuilder::finish() {
  if (!centers_.empty()) move_origin();
  if (const auto id = repeated_id(map_.ids.data(), map_.size())) {
    input_.fail("ids: " + std::to_string(*id) + " occurs more than once");
  }
  PlyContents contents{std::move(map_), {}};
  for (const Property& property : vertex_.properties) {
    if (unused_.count(property.name) > 0) contents.ignored_properties.push_back(property.name);
  }
  return contents;
}

PlyContents read(Input& input) {
  const Header header = read_header(input);
  const auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                                   [](const Element& element) { return element.name == "vertex"; });
  if (vertex == header.elements.end()) input.fail("the header has no element 'vertex'");
  if (is_compressed(*vertex)) return read_compressed(header, *vertex, input);
  MapBuilder builder(*vertex, header, input);
  RowReader reader(input, header.format);
  for (const Element& element : header.elements) {
    for (std::uint64_t row = 0; row < element.rows;) {
      const PackedRows rows = reader.read(element, row);
      if (&element == &*vertex) builder.add(rows);
      row += rows.count;
    }
  }
  reader.end();
  return builder.finish();
}

}  // namespace

PlyContents read_ply(const std::string& path) {
  Input input(path);
  return read(input);
}

PlyContents parse_ply(std::string_view bytes, const std::string& name) {
  Input input(bytes, name);
  return read(input);
}

}  // namespace gslts::io
