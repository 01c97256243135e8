#include "gslts/edit/thin.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace gslts::edit {
namespace {

/// Beyond so many cells from the first point a float could not tell neighbours apart.
constexpr double kFarthestCell = 1e15;

struct Cell {
  std::int64_t x, y, z;
  bool operator==(const Cell& other) const { return x == other.x && y == other.y && z == other.z; }
};

struct HashCell {
  std::size_t operator()(const Cell& cell) const {
    // Unsigned, as these products may overflow.
    return std::size_t(std::uint64_t(cell.x) * 73856093 ^ std::uint64_t(cell.y) * 19349663 ^
                       std::uint64_t(cell.z) * 83492791);
  }
};

void require_valid(const float* points, const float* spacing_m, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    if (!Eigen::Map<const Eigen::Vector3f>(points + 3 * i).allFinite()) {
      throw std::invalid_argument("thinned: points[" + std::to_string(i) + "] is not finite");
    }
    if (!(spacing_m[i] > 0) || !std::isfinite(spacing_m[i])) {
      throw std::invalid_argument("thinned: spacing_m[" + std::to_string(i) +
                                  "] must be positive and finite, got " +
                                  std::to_string(spacing_m[i]));
    }
  }
}

}  // namespace

Array<std::uint32_t> thinned(const float* points, const float* spacing_m, std::size_t count) {
  require_valid(points, spacing_m, count);
  Array<std::uint32_t> stay;
  if (count == 0) return stay;
  // A cell as wide as the greatest spacing: only the 27 around a point can hold one too near.
  const double edge_m = double(*std::max_element(spacing_m, spacing_m + count));
  const Eigen::Map<const Eigen::Vector3f> first(points);
  std::unordered_map<Cell, std::vector<std::uint32_t>, HashCell> cells;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(points + 3 * i).cast<double>();
    const Eigen::Vector3d place = ((point - first.cast<double>()) / edge_m)
                                      .array()
                                      .floor()
                                      .max(-kFarthestCell)
                                      .min(kFarthestCell);
    const Cell home{std::int64_t(place.x()), std::int64_t(place.y()), std::int64_t(place.z())};
    const double least = double(spacing_m[i]) * double(spacing_m[i]);
    bool free = true;
    for (int k = 0; k < 27 && free; ++k) {
      const auto cell =
          cells.find({home.x + k % 3 - 1, home.y + k / 3 % 3 - 1, home.z + k / 9 - 1});
      if (cell == cells.end()) continue;
      free = std::none_of(cell->second.begin(), cell->second.end(), [&](std::uint32_t row) {
        const Eigen::Map<const Eigen::Vector3f> other(points + 3 * std::size_t(row));
        return (other.cast<double>() - point).squaredNorm() < least;
      });
    }
    if (!free) continue;
    cells[home].push_back(std::uint32_t(i));
    stay.push_back(std::uint32_t(i));
  }
  return stay;
}

}  // namespace gslts::edit
