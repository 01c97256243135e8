#include "ply_compressed.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "ply_layout.hpp"
#include "ply_rows.hpp"
#include "ply_values.hpp"

namespace gslts::io {
namespace {

/// Number of Gaussians that share a row of `chunk`.
constexpr std::size_t kChunkRows = 256;

constexpr double kSqrt2 = 1.4142135623730951;

/// The `bits` lowest bits as a number from 0 to 1.
double unit_of(std::uint32_t packed, int bits) {
  const std::uint32_t greatest = (std::uint32_t{1} << bits) - 1;
  return static_cast<double>(packed & greatest) / greatest;
}

/// Unpacks three numbers from 0 to 1 of 11, 10 and 11 bits.
Eigen::Vector3d units_of(std::uint32_t packed) {
  return {unit_of(packed >> 21, 11), unit_of(packed >> 11, 10), unit_of(packed, 11)};
}

/// Unpacks a quaternion, wxyz.
Eigen::Vector4d quat_of(std::uint32_t packed) {
  const Eigen::Vector3d others =
      kSqrt2 * Eigen::Vector3d(unit_of(packed >> 20, 10) - 0.5, unit_of(packed >> 10, 10) - 0.5,
                               unit_of(packed, 10) - 0.5);
  const int largest = static_cast<int>(packed >> 30);
  Eigen::Vector4d quat;
  for (int i = 0, next = 0; i < 4; ++i) {
    quat[i] = i == largest ? std::sqrt(std::max(0.0, 1 - others.squaredNorm())) : others[next++];
  }
  return quat;
}

double coefficient_of(std::uint8_t packed) {
  const double unit = packed == 0 ? 0 : packed == 255 ? 1 : (packed + 0.5) / 256;
  return 8 * (unit - 0.5);
}

/// Limits of the values of up to `kChunkRows` Gaussians.
struct Bounds {
  Eigen::Vector3d low, high;

  Eigen::Vector3d at(const Eigen::Vector3d& unit) const {
    return low.cwiseProduct(Eigen::Vector3d::Ones() - unit) + high.cwiseProduct(unit);
  }
};

struct Chunk {
  Bounds means, log_scales, colors;
};

/// Finds properties of an element, all of one type.
class Properties {
 public:
  Properties(const Element& element, Scalar type, const Input& input)
      : element_(element), type_(type), input_(input) {}

  bool has(const std::string& name) const {
    return std::any_of(element_.properties.begin(), element_.properties.end(),
                       [&](const Property& property) { return property.name == name; });
  }

  /// Returns the offset of a property in a packed row.
  std::size_t offset(const std::string& name) const {
    std::size_t offset = 0;
    for (const Property& property : element_.properties) {
      if (property.name == name) {
        if (property.length_type || property.type != type_) {
          input_.fail_at_line(property.line, quoted(name) + " must be of type " + name_of(type_));
        }
        return offset;
      }
      if (!property.length_type) offset += size_of(property.type);
    }
    input_.fail_at_line(element_.line,
                        "element " + quoted(element_.name) + " lacks property " + quoted(name));
  }

  /// Returns the offsets of three properties.
  std::vector<std::size_t> offsets(const std::string& prefix, const std::string& letters) const {
    std::vector<std::size_t> result;
    for (char letter : letters) result.push_back(offset(prefix + letter));
    return result;
  }

 private:
  const Element& element_;
  Scalar type_;
  const Input& input_;
};

/// Turns the rows of the elements into a map.
class CompressedReader {
 public:
  CompressedReader(const Header& header, const Element& vertex, Input& input);

  PlyContents read();

 private:
  void prepare_chunks();
  void prepare_harmonics();
  void add_chunk(const char* row);
  void add_vertex(const char* row);
  void add_harmonics(const char* row);
  const Element* find(const std::string& name) const;
  Bounds bounds_at(const char* row, std::size_t first) const;
  void store(const char* name, const Eigen::Vector3d& values, float* to) const;

  const Header& header_;
  const Element& vertex_;
  Input& input_;
  const bool big_endian_;
  const Element* chunk_;      // Always there.
  const Element* harmonics_;  // Or null.
  std::vector<std::size_t> chunk_offsets_, vertex_offsets_, harmonics_offsets_;
  std::vector<Chunk> chunks_;
  GaussianMap map_;
  std::size_t vertices_ = 0, harmonics_rows_ = 0;  // Added so far.
};

CompressedReader::CompressedReader(const Header& header, const Element& vertex, Input& input)
    : header_(header),
      vertex_(vertex),
      input_(input),
      big_endian_(header.format == Format::kBigEndian),
      chunk_(find("chunk")),
      harmonics_(find("sh")) {
  prepare_chunks();
  const Properties packed(vertex, Scalar::kUint32, input);
  for (const char* name : {"position", "rotation", "scale", "color"}) {
    vertex_offsets_.push_back(packed.offset(std::string("packed_") + name));
  }
  prepare_harmonics();
  const std::size_t bases = 1 + harmonics_offsets_.size() / 3;
  map_ = make_gaussian_map<float>(static_cast<std::size_t>(vertex.rows), static_cast<int>(bases));
  map_.origin = header.origin.value_or(Eigen::Vector3d::Zero());
}

const Element* CompressedReader::find(const std::string& name) const {
  const auto found = std::find_if(header_.elements.begin(), header_.elements.end(),
                                  [&](const Element& element) { return element.name == name; });
  return found == header_.elements.end() ? nullptr : &*found;
}

void CompressedReader::prepare_chunks() {
  if (chunk_ == nullptr || chunk_ > &vertex_) {
    input_.fail_at_line(vertex_.line, "packed vertices without an element 'chunk' before them");
  }
  const std::uint64_t wanted = vertex_.rows / kChunkRows + (vertex_.rows % kChunkRows > 0 ? 1 : 0);
  if (chunk_->rows != wanted) {
    input_.fail_at_line(chunk_->line, "expected " + std::to_string(wanted) + " chunks for " +
                                          std::to_string(vertex_.rows) + " vertices, got " +
                                          std::to_string(chunk_->rows));
  }
  const Properties bounds(*chunk_, Scalar::kFloat32, input_);
  const auto add = [&](const std::string& suffix, const std::string& letters) {
    for (const char* limit : {"min_", "max_"}) {
      const auto offsets = bounds.offsets(limit + suffix, letters);
      chunk_offsets_.insert(chunk_offsets_.end(), offsets.begin(), offsets.end());
    }
  };
  add("", "xyz");
  add("scale_", "xyz");
  if (bounds.has("min_r")) add("", "rgb");
}

void CompressedReader::prepare_harmonics() {
  if (harmonics_ == nullptr) return;
  const Properties packed(*harmonics_, Scalar::kUint8, input_);
  const std::size_t count = harmonics_->properties.size();
  if (count != 9 && count != 24 && count != 45) {
    input_.fail_at_line(
        harmonics_->line,
        "degrees 1 to 3 have 9, 24 or 45 properties f_rest_, got " + std::to_string(count));
  }
  if (harmonics_->rows != vertex_.rows) {
    input_.fail_at_line(harmonics_->line, "element 'sh' has " + std::to_string(harmonics_->rows) +
                                              " rows, element 'vertex' " +
                                              std::to_string(vertex_.rows));
  }
  for (std::size_t i = 0; i < count; ++i) {
    harmonics_offsets_.push_back(packed.offset("f_rest_" + std::to_string(i)));
  }
}

/// Returns the bounds of which the offsets begin at number `first`.
Bounds CompressedReader::bounds_at(const char* row, std::size_t first) const {
  const auto limit = [&](std::size_t begin) {
    Eigen::Vector3d values;
    for (std::size_t i = 0; i < 3; ++i) {
      const float value = load<float>(row + chunk_offsets_[begin + i], big_endian_);
      if (!std::isfinite(value)) {
        input_.fail("chunk " + std::to_string(chunks_.size()) + ": a bound is not finite");
      }
      values[static_cast<Eigen::Index>(i)] = value;
    }
    return values;
  };
  return {limit(first), limit(first + 3)};
}

void CompressedReader::add_chunk(const char* row) {
  Chunk chunk{
      bounds_at(row, 0), bounds_at(row, 6), {Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()}};
  if (chunk_offsets_.size() > 12) chunk.colors = bounds_at(row, 12);
  chunks_.push_back(chunk);
}

/// Stores three values of a Gaussian.
void CompressedReader::store(const char* name, const Eigen::Vector3d& values, float* to) const {
  Eigen::Map<Eigen::Vector3f> stored(to);
  stored = values.cast<float>();
  if (!stored.allFinite()) {
    input_.fail("vertex " + std::to_string(vertices_) + ": " + name + ": a value exceeds float");
  }
}

void CompressedReader::add_vertex(const char* row) {
  const auto packed = [&](std::size_t i) {
    return load<std::uint32_t>(row + vertex_offsets_[i], big_endian_);
  };
  const std::size_t i = vertices_;
  const std::size_t bases = static_cast<std::size_t>(map_.sh_bases);
  const Chunk& chunk = chunks_[i / kChunkRows];
  store("packed_position", chunk.means.at(units_of(packed(0))), map_.means.data() + 3 * i);
  Eigen::Map<Eigen::Vector4f>(map_.quats.data() + 4 * i) = quat_of(packed(1)).cast<float>();
  store("packed_scale", chunk.log_scales.at(units_of(packed(2))), map_.log_scales.data() + 3 * i);
  const std::uint32_t rgba = packed(3);
  const Eigen::Vector3d color =
      chunk.colors.at({unit_of(rgba >> 24, 8), unit_of(rgba >> 16, 8), unit_of(rgba >> 8, 8)});
  store("packed_color", color.unaryExpr(&sh_of_color), map_.sh.data() + 3 * bases * i);
  map_.logit_opacities[i] = static_cast<float>(logit_of(unit_of(rgba, 8)));
  ++vertices_;
}

void CompressedReader::add_harmonics(const char* row) {
  const std::size_t rest = harmonics_offsets_.size() / 3;
  float* const sh = map_.sh.data() + 3 * (rest + 1) * harmonics_rows_;
  for (std::size_t i = 0; i < harmonics_offsets_.size(); ++i) {
    const std::size_t channel = i / rest, basis = 1 + i % rest;
    const auto packed = load<std::uint8_t>(row + harmonics_offsets_[i], big_endian_);
    sh[3 * basis + channel] = static_cast<float>(coefficient_of(packed));
  }
  ++harmonics_rows_;
}

PlyContents CompressedReader::read() {
  RowReader reader(input_, header_.format);
  for (const Element& element : header_.elements) {
    const std::size_t row_bytes = packed_row_bytes(element);
    for (std::uint64_t row = 0; row < element.rows;) {
      const PackedRows rows = reader.read(element, row);
      for (std::size_t i = 0; i < rows.count; ++i) {
        const char* const first = rows.first + i * row_bytes;
        if (&element == chunk_) add_chunk(first);
        if (&element == &vertex_) add_vertex(first);
        if (&element == harmonics_) add_harmonics(first);
      }
      row += rows.count;
    }
  }
  reader.end();
  return {std::move(map_), {}};
}

}  // namespace

bool is_compressed(const Element& vertex) {
  return std::any_of(vertex.properties.begin(), vertex.properties.end(),
                     [](const Property& property) { return property.name == "packed_position"; });
}

PlyContents read_compressed(const Header& header, const Element& vertex, Input& input) {
  return CompressedReader(header, vertex, input).read();
}

}  // namespace gslts::io
