#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/gaussian_map.hpp"

namespace gslts::edit {

/// Creates Gaussians at points with the attributes of others: rotation, scales, opacity, colour and
/// features.
/// @param points  [count,3] centres relative to the origin of `gaussians`, m.
/// @param rows  [count] rows of the Gaussians to inherit from; a row may occur any number of times.
/// @param first_id  The new Gaussians get the ids first_id, first_id + 1, ...
/// @throws std::invalid_argument  if the Gaussians are not valid or there is no such row.
///
/// Source: GS-LTS, sec. III-D2, the pre-editing of an addition, steps iii and iv (eq. 12).
GaussianMap inherit_attributes(const GaussianView<float>& gaussians, const float* points,
                               const std::uint32_t* rows, std::size_t count,
                               std::uint64_t first_id);

}  // namespace gslts::edit
