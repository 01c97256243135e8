#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "constants.hpp"
#include "gslts/map/array.hpp"
#include "gslts/map/chunk_bounds.hpp"

namespace gslts::raster {

/// A Gaussian projected to the image; one cache line in float.
///
/// Its footprint is stored as the whitening transform of the projected covariance, because sums of
/// squares neither cancel nor need a division: with d = pixel centre - mean,
///   u = uu d_x + uv d_y,   v = vv d_y,   log2(alpha) = log2_opacity - u^2 - v^2.
template <typename T>
struct alignas(64) Splat {
  T mean_x, mean_y;  ///< px
  T uu, uv, vv;      ///< 1/px
  T log2_opacity;
  T color[3];
  T depth;                 ///< z of the centre in the camera frame, m
  T depth_u, depth_v;      ///< At a pixel it is depth + depth_u u + depth_v v.
  std::uint32_t gaussian;  ///< Row of the map.
};

/// Tiles that a splat may touch, half-open; empty if none.
struct TileRect {
  std::uint16_t x0, y0, x1, y1;
};

/// Bits of a positive floating-point number: they sort as the numbers do.
template <typename T>
using DepthBits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;

template <typename T>
DepthBits<T> depth_bits(T depth) {
  DepthBits<T> bits;
  std::memcpy(&bits, &depth, sizeof(bits));
  return bits;
}

/// Key by which a splat is sorted into the lists of the tiles.
template <typename T>
struct SplatKey {
  TileRect rect;
  DepthBits<T> depth;
};

/// The Gaussians that the camera sees, of C chunks of the map that may be in view. Chunk c of these
/// owns the slots from c * kChunkSize on and fills the first counts[c] of them, in the order of the
/// map; the slots between hold nothing.
template <typename T>
struct Splats {
  Array<Splat<T>> splats;
  Array<SplatKey<T>> keys;
  std::vector<std::uint32_t> chunks;  ///< [C] rows of the chunks in the map, ascending
  std::vector<std::uint32_t> counts;  ///< [C]
  std::vector<std::uint64_t> areas;   ///< [C] area of the rectangles of each chunk, in tiles.
};

}  // namespace gslts::raster
