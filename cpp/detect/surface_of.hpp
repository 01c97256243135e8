#pragma once

#include <optional>
#include <vector>

#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect {

/// Indices of pixels, ascending.
using Pixels = std::vector<std::size_t>;

/// What the photo (after) or the map (before) shows in these pixels; nothing if it has no depth
/// there. Label and flatness are left to the caller.
std::optional<Surface> surface_of(const Views& views, const Pixels& pixels, Side side);

}  // namespace gslts::detect
