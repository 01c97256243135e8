#include "gslts/edit/thin_points.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "constants.hpp"
#include "gslts/map/require.hpp"

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
  require_finite_points("thin_points", "points", points, count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!(spacing_m[i] > 0) || !std::isfinite(spacing_m[i])) {
      throw std::invalid_argument("thin_points: spacing_m[" + std::to_string(i) +
                                  "] must be positive and finite, got " +
                                  std::to_string(spacing_m[i]));
    }
  }
}

/// The points kept so far, in a grid for each power of two of the spacings: the 27 cells around a
/// point, wider than its spacing, hold all that are too near. In one grid for the greatest spacing
/// a few cells could hold them all.
class KeptPoints {
 public:
  KeptPoints(const float* points, const float* spacing_m, std::size_t count) : points_(points) {
    for (std::size_t i = 0; i < count; ++i) grids_[exponent_of(spacing_m[i])];
  }

  /// Keeps a point, unless one is nearer than its spacing.
  bool keep(std::uint32_t row, float spacing_m) {
    const Eigen::Vector3d point = point_at(row);
    if (has_near(point, spacing_m)) return false;
    for (auto& [exponent, grid] : grids_) grid[cell_of(point, exponent)].push_back(row);
    return true;
  }

 private:
  using Grid = std::unordered_map<Cell, std::vector<std::uint32_t>, HashCell>;

  /// Exponent of the smallest power of two above a number.
  static int exponent_of(float value) {
    int exponent = 0;
    std::frexp(value, &exponent);
    return exponent;
  }

  bool has_near(const Eigen::Vector3d& point, double spacing_m) const {
    const int exponent = exponent_of(float(spacing_m));
    const Grid& grid = grids_.at(exponent);
    const Cell home = cell_of(point, exponent);
    const auto is_near = [&](std::uint32_t other) {
      return (point_at(other) - point).squaredNorm() < spacing_m * spacing_m;
    };
    constexpr std::array<int, 3> kSteps{0, -1, 1};  // The nearest cell first.
    for (std::size_t k = 0; k < 27; ++k) {
      const auto cell =
          grid.find({home.x + kSteps[k % 3], home.y + kSteps[k / 3 % 3], home.z + kSteps[k / 9]});
      if (cell == grid.end()) continue;
      if (std::any_of(cell->second.begin(), cell->second.end(), is_near)) return true;
    }
    return false;
  }

  Eigen::Vector3d point_at(std::uint32_t row) const {
    return Eigen::Map<const Eigen::Vector3f>(points_ + 3 * std::size_t(row)).cast<double>();
  }

  /// Returns the cell of a point in the grid whose cells are 2^exponent wide.
  Cell cell_of(const Eigen::Vector3d& point, int exponent) const {
    const Eigen::Vector3d index = ((point - point_at(0)) * std::ldexp(1, -exponent))
                                      .array()
                                      .floor()
                                      .max(-kMaxCell)
                                      .min(kMaxCell);
    return {std::int64_t(index.x()), std::int64_t(index.y()), std::int64_t(index.z())};
  }

  const float* points_;
  std::map<int, Grid> grids_;  ///< By the exponent of the width of their cells.
};

}  // namespace

Array<std::uint32_t> thin_points(const float* points, const float* spacing_m, std::size_t count) {
  require_valid(points, spacing_m, count);
  Array<std::uint32_t> rows;
  if (count == 0) return rows;
  KeptPoints kept(points, spacing_m, count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (kept.keep(i, spacing_m[i])) rows.push_back(i);
  }
  return rows;
}

}  // namespace gslts::edit
