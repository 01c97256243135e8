#pragma once

#include "gslts/detect/masks.hpp"
#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"
#include "surface_of.hpp"

namespace gslts::detect {

/// What the pixels (at least one) of a surface, and those around them, tell beside steps and how
/// many differ.
Evidence evidence_of(const Views& views, const Masks& masks, const Pixels& pixels,
                     const Surface& surface);

}  // namespace gslts::detect
