#include "gslts/edit/nearest.hpp"

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "gslts/map/require.hpp"

namespace gslts::edit {
namespace {

void require_valid(const GaussianView<float>& gaussians, const float* points, std::size_t count,
                   int k) {
  validate(gaussians, "nearest_gaussians");
  if (k < 1) {
    throw std::invalid_argument("nearest_gaussians: k must be at least 1, got " +
                                std::to_string(k));
  }
  if (gaussians.size == 0) throw std::invalid_argument("nearest_gaussians: there is no Gaussian");
  require_finite_points("nearest_gaussians", "means", gaussians.means, gaussians.size);
  require_finite_points("nearest_gaussians", "points", points, count);
}

}  // namespace

Neighbours nearest_gaussians(const GaussianView<float>& gaussians, const float* points,
                             std::size_t count, int k) {
  require_valid(gaussians, points, count, k);
  const std::size_t found = std::min(std::size_t(k), gaussians.size);
  Neighbours result{int(found), Array<std::uint32_t>(count * found), Array<float>(count * found)};
  if (count == 0) return result;
  // FLANN takes pointers to what it only reads.
  const flann::Matrix<float> means(const_cast<float*>(gaussians.means), gaussians.size, 3);
  const flann::Matrix<float> queries(const_cast<float*>(points), count, 3);
  flann::KDTreeSingleIndex<flann::L2_3D<float>> index(means, flann::KDTreeSingleIndexParams());
  index.buildIndex();
  std::vector<std::size_t> rows(count * found);
  flann::Matrix<std::size_t> row_table(rows.data(), count, found);
  flann::Matrix<float> distances(result.distances_m.data(), count, found);
  flann::SearchParams exact(flann::FLANN_CHECKS_UNLIMITED);
  exact.cores = 1;
  index.knnSearch(queries, row_table, distances, found, exact);
  std::transform(rows.begin(), rows.end(), result.rows.begin(),
                 [](std::size_t row) { return std::uint32_t(row); });
  for (float& distance : result.distances_m) distance = std::sqrt(distance);  // They are squared.
  return result;
}

}  // namespace gslts::edit
