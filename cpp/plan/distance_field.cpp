#include "gslts/plan/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "gslts/map/require.hpp"

namespace gslts::plan {
namespace {

/// Name in messages.
constexpr const char* kFunction = "distance_field";
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Maximum number of rows or columns: 65,536 cells of 5 cm are 3 km.
constexpr int kMaxSize = 65536;

/// Upwind derivative along one axis, in cells: weight * (distance - from).
struct Slope {
  double from = kInfinity;
  double weight = 1;

  double alone() const { return from + 1 / weight; }
};

/// The distance whose derivatives have length 1; by one axis alone if two do not meet.
double solve(const Slope& a, const Slope& b) {
  const double along_one = std::min(a.alone(), b.alone());
  if (std::isinf(a.from) || std::isinf(b.from)) return along_one;
  const double a2 = a.weight * a.weight, b2 = b.weight * b.weight;
  const double half = a2 * a.from + b2 * b.from;
  const double rest = a2 * a.from * a.from + b2 * b.from * b.from - 1;
  const double discriminant = half * half - (a2 + b2) * rest;
  if (discriminant < 0) return along_one;
  const double distance = (half + std::sqrt(discriminant)) / (a2 + b2);
  return distance >= std::max(a.from, b.from) ? distance : along_one;
}

/// Distances, in cells, that grow from the goals in the order of their size.
class Front {
 public:
  Front(const std::uint8_t* free, int rows, int columns)
      : free_(free),
        rows_(rows),
        columns_(columns),
        distances_(std::size_t(rows) * std::size_t(columns), kInfinity),
        is_final_(distances_.size(), 0) {}

  void start(std::size_t cell) { propose(cell, 0); }

  void march() {
    while (!next_.empty()) {
      const std::size_t cell = next_.top().second;
      next_.pop();
      if (is_final_[cell]) continue;
      is_final_[cell] = 1;
      const int row = int(cell / std::size_t(columns_)), column = int(cell % std::size_t(columns_));
      for (const auto& [i, j] : {Step{-1, 0}, Step{1, 0}, Step{0, -1}, Step{0, 1}}) {
        if (!contains(row + i, column + j)) continue;
        const std::size_t beside = index(row + i, column + j);
        if (!free_[beside] || is_final_[beside]) continue;
        const Slope down = slope(row + i, column + j, 1, 0),
                    across = slope(row + i, column + j, 0, 1);
        propose(beside, solve(down, across));
      }
    }
  }

  Array<double> distances_m(double cell_m) const {
    Array<double> result(distances_.size());
    std::transform(distances_.begin(), distances_.end(), result.begin(),
                   [&](double cells) { return cells * cell_m; });
    return result;
  }

 private:
  using Step = std::pair<int, int>;
  using Candidate = std::pair<double, std::size_t>;

  bool contains(int row, int column) const {
    return row >= 0 && row < rows_ && column >= 0 && column < columns_;
  }

  std::size_t index(int row, int column) const {
    return std::size_t(row) * std::size_t(columns_) + std::size_t(column);
  }

  double final_at(int row, int column) const {
    if (!contains(row, column) || !is_final_[index(row, column)]) return kInfinity;
    return distances_[index(row, column)];
  }

  void propose(std::size_t cell, double distance) {
    if (!(distance < distances_[cell])) return;
    distances_[cell] = distance;
    next_.emplace(distance, cell);
  }

  /// Upwind derivative at a cell; of second order where two cells in a row are final.
  Slope slope(int row, int column, int i, int j) const {
    const double before = final_at(row - i, column - j), after = final_at(row + i, column + j);
    const int sign = before < after ? -1 : 1;
    const double near = std::min(before, after);
    const double far = final_at(row + 2 * sign * i, column + 2 * sign * j);
    if (std::isinf(near) || far > near) return {near, 1};
    return {(4 * near - far) / 3, 1.5};
  }

  const std::uint8_t* free_;
  int rows_, columns_;
  std::vector<double> distances_;
  std::vector<std::uint8_t> is_final_;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> next_;
};

}  // namespace

Array<double> distance_field(const std::uint8_t* free, const std::uint8_t* goals, int rows,
                             int columns, double cell_m) {
  require(rows >= 0 && rows <= kMaxSize, kFunction, "rows must be in 0..65536", rows);
  require(columns >= 0 && columns <= kMaxSize, kFunction, "columns must be in 0..65536", columns);
  require(cell_m > 0 && std::isfinite(cell_m), kFunction, "cell_m must be positive and finite",
          cell_m);
  Front front(free, rows, columns);
  for (std::size_t cell = 0; cell < std::size_t(rows) * std::size_t(columns); ++cell) {
    if (free[cell] && goals[cell]) front.start(cell);
  }
  front.march();
  return front.distances_m(cell_m);
}

}  // namespace gslts::plan
