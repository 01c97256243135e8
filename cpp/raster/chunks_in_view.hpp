#pragma once

#include <cstdint>
#include <vector>

#include "gslts/map/gaussian_map.hpp"
#include "setup.hpp"

namespace gslts::raster {

/// Lists the chunks of the map that may touch the wanted region, ascending; all of them if the map
/// has no bounds. `cull_chunk` finds nothing in any other chunk.
template <typename T>
std::vector<std::uint32_t> chunks_in_view(const GaussianView<T>& gaussians,
                                          const RenderSetup<T>& setup);

}  // namespace gslts::raster
