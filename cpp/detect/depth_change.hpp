#pragma once

#include <cstdint>

#include "gslts/detect/objects.hpp"

namespace gslts::detect {

/// [H,W] each, 1 where a surface is that only one of the two shows.
struct DepthChange {
  Array<std::uint8_t> appeared;  ///< The photo's is nearer than all of the map's around it.
  Array<std::uint8_t> vanished;  ///< The map's is nearer than all of the photo's around it.
  Array<float> steps;  ///< Difference of depths in units of the least that counts; 0 if unknown.
};

/// Looking at all surfaces within `reach_px` forgives edges that stand a little beside their place,
/// and thin things that the sensor or the map does not show there.
DepthChange depth_change_of(const Views& views, const Masks& masks, const ObjectRule& rule);

}  // namespace gslts::detect
