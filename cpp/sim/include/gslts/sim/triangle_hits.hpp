#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts::sim {

/// Rays and the triangle that each hits: arrays of the caller.
struct RayTriangles {
  std::size_t size;            ///< N
  const float* rays;           ///< [N,6] origin, m, and direction of any length, world.
  const std::uint32_t* hit;    ///< [N] index of a triangle; `kNoTriangle` where nothing is hit.
  std::size_t triangle_count;  ///< T
  const float* corners;        ///< [T,3,3] m, world.
};

/// Index where a ray hits nothing, that of Embree.
constexpr std::uint32_t kNoTriangle = 0xffffffff;

/// Points where rays meet triangles.
struct TriangleHits {
  Array<float> distance;  ///< [N] in lengths of the direction; infinite where nothing is hit.
  Array<float> weights;   ///< [N,2] barycentric, of the second and third corner; 0 for a miss.
};

/// Computes where rays meet triangles that are known to be hit, in double precision.
///
/// A ray tracer approximates reciprocals by instructions whose last bits depend on the processor;
/// its choice of triangle does not. Source: Möller and Trumbore 1997.
///
/// @param threads  0 means one a hardware thread.
/// @throws std::invalid_argument  if an index is out of range or threads is negative.
TriangleHits intersect_triangles(const RayTriangles& given, int threads);

}  // namespace gslts::sim
