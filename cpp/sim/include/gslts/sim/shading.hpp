#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/sim/surfaces.hpp"

namespace gslts::sim {

/// A parallelogram that emits light to the side of cross(edge_u, edge_v).
struct AreaLight {
  Eigen::Vector3d center;          ///< m, world.
  Eigen::Vector3d edge_u, edge_v;  ///< m, from one side to the other.
  Eigen::Vector3d radiance;        ///< Linear RGB.
};

/// First hits of the rays of an image: arrays of the caller, which must outlive `Shading`.
struct Hits {
  int width, height;               ///< px
  float pixel_rad;                 ///< Angle of a pixel: 1 / focal length.
  const float* rays;               ///< [H,W,6] origin, m, and direction; see `pixel_rays`.
  const float* depth;              ///< [H,W] m, infinite where nothing is hit.
  const std::uint32_t* triangles;  ///< [H,W] index of the triangle that is hit.
  const float* weights;            ///< [H,W,2] barycentric weights of its second and third corner.
};

/// An image under area lights, in two steps: between them, the caller casts the shadow rays.
///
/// Each pixel sees one of 4 x 4 points of every light. The points differ within tiles of 4 x 4
/// pixels, over which the light is averaged where they show one surface.
class Shading {
 public:
  /// @param surfaces, hits  Must outlive the object.
  /// @param threads  0 means one per hardware thread; the result does not depend on it.
  /// @throws std::invalid_argument  if a hit names a triangle that is not there, the size is not
  ///   positive, or threads is negative.
  Shading(const Surfaces& surfaces, const Hits& hits, const std::vector<AreaLight>& lights,
          int threads);

  /// [R,6] origins, m, and the vectors to the lights, of the rays that may carry light.
  const Array<float>& shadow_rays() const { return shadow_rays_; }

  /// Computes the image.
  ///
  /// @param blocked  [R] nonzero where a shadow ray is blocked.
  /// @param ambient  Linear RGB of the ambient light.
  /// @return  [H,W,3] linear RGB; 0 where nothing was hit.
  Array<float> radiance(const std::uint8_t* blocked, const Eigen::Vector3d& ambient) const;

  const Array<float>& depth() const { return depth_; }      ///< [H,W] m, 0 for no hit.
  const Array<float>& cosines() const { return cosines_; }  ///< [H,W] of normal and ray, or 0.
  const Array<std::int32_t>& objects() const { return objects_; }  ///< [H,W] index, -1 for no hit.

 private:
  /// A light in single precision, and its points: [row][column] in a tile.
  struct Light {
    std::array<std::array<Eigen::Vector3f, 4>, 4> points;
    Eigen::Vector3f normal, radiance;
    float scale;  ///< Area / pi.
  };
  /// A vector a pixel, each coordinate in [H,W] of its own, so that loops become vector code.
  using Planes = std::array<Array<float>, 3>;

  static Light prepared(const AreaLight& light);
  void look_up_row(std::size_t row);
  void light_row(std::size_t row, const Light& light, float* factors) const;
  void write_shadow_rays(std::size_t row);
  void start_points(std::size_t row, float* x, float* y, float* z) const;
  void direct_row(std::size_t row, const std::uint8_t* blocked, Planes& direct) const;
  void radiance_row(std::size_t row, const Planes& direct, const Eigen::Vector3f& ambient,
                    float* radiance) const;

  const Surfaces& surfaces_;
  Hits hits_;
  std::vector<Light> lights_;
  int threads_;
  Planes normals_;                      ///< [H,W] each, towards the camera.
  Array<float> depth_, cosines_;        ///< [H,W]
  Array<std::int32_t> objects_;         ///< [H,W]
  Array<Eigen::Array4f> albedo_;        ///< [H,W] RGB, 0
  Array<float> emission_;               ///< [H,W]
  Array<float> factors_;                ///< [H,L,W] light that may arrive for a radiance of 1.
  std::vector<std::size_t> first_ray_;  ///< [H+1] index of the first shadow ray of each row.
  Array<float> shadow_rays_;
};

}  // namespace gslts::sim
