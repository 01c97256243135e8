#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::raster {

/// Lists the chunks of a map that a rendering reads, ascending: all of them if the map has no
/// bounds. Gaussians of other chunks contribute nothing.
/// @throws std::invalid_argument  for a bad map, camera or option.
template <typename T>
std::vector<std::uint32_t> chunks_in_view(const GaussianView<T>& gaussians, const Camera& camera,
                                          const RenderOptions& options = {});

}  // namespace gslts::raster
