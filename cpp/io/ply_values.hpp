#pragma once

#include <algorithm>
#include <cmath>

namespace gslts::io {

/// The stored opacity for opaque (and, negated, for transparent): its sigmoid is 1 in float.
/// Other programs store infinity.
constexpr float kOpaqueLogit = 20;

/// The stored scale for a Gaussian without extent in a direction: 1e-13 m, and its square is no
/// denormal. Other programs store minus infinity.
constexpr float kFlatLogScale = -30;

/// Minimum distance of centres in double from the origin, along an axis, at which the origin is
/// moved: float rounds them by 0.1 mm there.
constexpr double kMinOrigin = 2048;

/// Maximum coordinate of such an origin: centres relative to it are floats, whatever they are.
constexpr double kMaxOrigin = 1e12;

/// Value of the constant spherical harmonic.
constexpr double kSh0 = 0.28209479177387814;

/// The coefficient of degree 0 for a colour from 0 to 1.
inline double sh_of_color(double color) { return (color - 0.5) / kSh0; }

/// The stored opacity for an opacity from 0 to 1.
inline double logit_of(double opacity) {
  return std::clamp<double>(std::log(opacity / (1 - opacity)), -kOpaqueLogit, kOpaqueLogit);
}

}  // namespace gslts::io
