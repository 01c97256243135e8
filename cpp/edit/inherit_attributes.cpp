#include "gslts/edit/inherit_attributes.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace gslts::edit {
namespace {

void copy_rows(const float* from, const std::uint32_t* rows, std::size_t count, std::size_t columns,
               Array<float>& to) {
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(from + std::size_t(rows[i]) * columns, columns, to.data() + i * columns);
  }
}

}  // namespace

GaussianMap inherit_attributes(const GaussianView<float>& gaussians, const float* points,
                               const std::uint32_t* rows, std::size_t count,
                               std::uint64_t first_id) {
  validate(gaussians, "inherit_attributes");
  for (std::size_t i = 0; i < count; ++i) {
    if (rows[i] >= gaussians.size) {
      throw std::invalid_argument("inherit_attributes: rows[" + std::to_string(i) +
                                  "] must be below " + std::to_string(gaussians.size) + ", got " +
                                  std::to_string(rows[i]));
    }
  }
  GaussianMap map =
      make_gaussian_map<float>(count, gaussians.sh_bases, gaussians.feature_dims, first_id);
  map.origin = gaussians.origin;
  std::copy_n(points, 3 * count, map.means.data());
  copy_rows(gaussians.quats, rows, count, 4, map.quats);
  copy_rows(gaussians.log_scales, rows, count, 3, map.log_scales);
  copy_rows(gaussians.logit_opacities, rows, count, 1, map.logit_opacities);
  copy_rows(gaussians.sh, rows, count, 3 * std::size_t(gaussians.sh_bases), map.sh);
  copy_rows(gaussians.features, rows, count, std::size_t(gaussians.feature_dims), map.features);
  return map;
}

}  // namespace gslts::edit
