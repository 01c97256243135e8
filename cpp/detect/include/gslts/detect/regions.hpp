#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "gslts/detect/masks.hpp"
#include "gslts/detect/objects.hpp"
#include "gslts/detect/surface.hpp"
#include "gslts/detect/views.hpp"

namespace gslts::detect {

/// Number of the numbers that `region_confidence` weighs.
inline constexpr std::size_t kRegionFeatures = 9;
using RegionFeatures = std::array<double, kRegionFeatures>;

/// A region of similar colours or depth steps in one image that the other image may not show.
struct Region {
  Side side;
  std::vector<std::size_t> pixels;  ///< Indices, row by row.
  RegionFeatures features;          ///< In the order of `kRegionWeights`.
};

/// Lists regions whose colours are not around in the other image, overlapping ones too: segments of
/// the frame and of the rendering, coarse and fine, and what is nearer than in the other image.
///
/// The rendering first gets the light of the frame. Depth may be missing, or coarse: it is
/// averaged.
/// @param masks  Of the same views.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
std::vector<Region> find_regions(const Views& views, const Masks& masks, const ObjectRule& rule);

/// Returns how likely a region is an object that changed, 0 to 1: logistic regression over regions
/// of real visits (benchmarks/results/detection.md).
double region_confidence(const RegionFeatures& features);

/// Finds the objects that only one of map and frame shows, by colours and, where there is any, by
/// coarse depth: for depth that is coarser than the steps that `find_changed_surfaces` looks for.
/// Of regions that overlap, the most likely one remains.
/// @param masks  Of the same views.
/// @throws std::invalid_argument  if the camera or a setting is invalid.
Surfaces find_changed_regions(const Views& views, const Masks& masks, const ObjectRule& rule);

}  // namespace gslts::detect
