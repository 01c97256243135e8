#include "gslts/edit/thin_points.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "constants.hpp"

namespace gslts::edit {
namespace {

struct Cell {
  std::int64_t x, y, z;
  bool operator==(const Cell& other) const { return x == other.x && y == other.y && z == other.z; }
};

struct HashCell {
  std::size_t operator()(const Cell& cell) const {
    // Unsigned, as these products may overflow.
    return std::size_t(std::uint64_t(cell.x) * kHashX ^ std::uint64_t(cell.y) * kHashY ^
                       std::uint64_t(cell.z) * kHashZ);
  }
};

void require_valid(const float* points, const float* spacing_m, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    if (!Eigen::Map<const Eigen::Vector3f>(points + 3 * i).allFinite()) {
      throw std::invalid_argument("thin_points: points[" + std::to_string(i) + "] is not finite");
    }
    if (!(spacing_m[i] > 0) || !std::isfinite(spacing_m[i])) {
      throw std::invalid_argument("thin_points: spacing_m[" + std::to_string(i) +
                                  "] must be positive and finite, got " +
                                  std::to_string(spacing_m[i]));
    }
  }
}

/// The points kept so far, in a grid whose cells are as wide as the greatest spacing: only the 27
/// cells around a point can hold one too near.
class KeptPoints {
 public:
  KeptPoints(const float* points, double edge_m) : points_(points), edge_m_(edge_m) {}

  /// Keeps a point, unless one is nearer than its spacing.
  bool keep(std::uint32_t row, double spacing_m) {
    const Eigen::Vector3d point = point_at(row);
    const Cell home = cell_of(point);
    for (int k = 0; k < 27; ++k) {
      const auto cell =
          cells_.find({home.x + k % 3 - 1, home.y + k / 3 % 3 - 1, home.z + k / 9 - 1});
      if (cell == cells_.end()) continue;
      const auto is_near = [&](std::uint32_t other) {
        return (point_at(other) - point).squaredNorm() < spacing_m * spacing_m;
      };
      if (std::any_of(cell->second.begin(), cell->second.end(), is_near)) return false;
    }
    cells_[home].push_back(row);
    return true;
  }

 private:
  Eigen::Vector3d point_at(std::uint32_t row) const {
    return Eigen::Map<const Eigen::Vector3f>(points_ + 3 * std::size_t(row)).cast<double>();
  }

  Cell cell_of(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d index =
        ((point - point_at(0)) / edge_m_).array().floor().max(-kMaxCell).min(kMaxCell);
    return {std::int64_t(index.x()), std::int64_t(index.y()), std::int64_t(index.z())};
  }

  const float* points_;
  double edge_m_;
  std::unordered_map<Cell, std::vector<std::uint32_t>, HashCell> cells_;
};

}  // namespace

Array<std::uint32_t> thin_points(const float* points, const float* spacing_m, std::size_t count) {
  require_valid(points, spacing_m, count);
  Array<std::uint32_t> rows;
  if (count == 0) return rows;
  KeptPoints kept(points, double(*std::max_element(spacing_m, spacing_m + count)));
  for (std::uint32_t i = 0; i < count; ++i) {
    if (kept.keep(i, double(spacing_m[i]))) rows.push_back(i);
  }
  return rows;
}

}  // namespace gslts::edit
