#include "gslts/sim/triangle_hits.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::sim {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kChunk = 4096;  ///< Rays a thread takes at a time.

Vector3d vector_at(const float* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

/// Distance along a ray, and barycentric weights of the second and third corner.
struct Hit {
  double distance, second, third;
};

/// A ray that hits nothing.
constexpr Hit kMiss{std::numeric_limits<double>::infinity(), 0, 0};

Hit intersect(const float* ray, const float* corners) {
  const Vector3d origin = vector_at(ray), direction = vector_at(ray + 3);
  const Vector3d first = vector_at(corners);
  const Vector3d edge2 = vector_at(corners + 3) - first, edge3 = vector_at(corners + 6) - first;
  const Vector3d p = direction.cross(edge3), s = origin - first, q = s.cross(edge2);
  const double determinant = edge2.dot(p);
  if (determinant == 0) return kMiss;  // The ray lies in the plane of the triangle.
  // The tracer hit it: the weights lie in the triangle but for rounding.
  const double second = std::clamp(s.dot(p) / determinant, 0.0, 1.0);
  const double third = std::clamp(direction.dot(q) / determinant, 0.0, 1.0 - second);
  return {edge3.dot(q) / determinant, second, third};
}

}  // namespace

TriangleHits intersect_triangles(const RayTriangles& given, int threads) {
  for (std::size_t i = 0; i < given.size; ++i) {
    if (given.hit[i] != kNoTriangle && given.hit[i] >= given.triangle_count) {
      throw std::invalid_argument("intersect_triangles: hit: there are " +
                                  std::to_string(given.triangle_count) + " triangles, got " +
                                  std::to_string(given.hit[i]));
    }
  }
  TriangleHits result{Array<float>(given.size), Array<float>(2 * given.size)};
  const std::size_t chunks = (given.size + kChunk - 1) / kChunk;
  parallel::parallel_for(chunks, threads, [&](std::size_t chunk) {
    const std::size_t end = std::min(given.size, (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      Hit hit = kMiss;
      if (given.hit[i] != kNoTriangle) {
        hit = intersect(given.rays + 6 * i, given.corners + 9 * std::size_t(given.hit[i]));
      }
      result.distance.data()[i] = float(hit.distance);
      result.weights.data()[2 * i] = float(hit.second);
      result.weights.data()[2 * i + 1] = float(hit.third);
    }
  });
  return result;
}

}  // namespace gslts::sim
