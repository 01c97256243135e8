#pragma once

#include <optional>

#include "gslts/detect/surface.hpp"
#include "images.hpp"

namespace gslts::detect {

/// Measures the surface that the frame (after) or the map (before) shows in some pixels.
/// @return  Nothing if there is no depth. Label, flatness and evidence are left to the caller.
std::optional<Surface> surface_of(const Views& views, const Pixels& pixels, Side side);

}  // namespace gslts::detect
