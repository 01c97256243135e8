#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gslts::sim {

/// Geometry and materials of T triangles: arrays of the caller.
struct TriangleArrays {
  std::size_t size;                 ///< T
  const float* normals;             ///< [T,3] unit vectors, world.
  const std::int32_t* objects;      ///< [T] index of the object that each belongs to.
  const float* emission;            ///< [T] radiance of a white texel that glows.
  const float* uvs;                 ///< [T,3,2] texture coordinates of the corners.
  const float* texels_per_m;        ///< [T] on the largest level of the texture.
  const std::int32_t* first_level;  ///< [T] index of that level.
  const std::int32_t* level_count;  ///< [T] number of levels, each half as large.
};

/// Textures with their mip levels: arrays of the caller.
struct TextureArrays {
  std::size_t level_count;    ///< L
  const std::int32_t* sizes;  ///< [L,2] height and width of each level, px.
  std::size_t texel_count;
  const std::uint32_t* texels;  ///< All levels one after the other: red + 256 green + 65536 blue.
  const float* linear_of_byte;  ///< [256] linear light of an sRGB byte.
};

/// A triangle, for shading.
struct Triangle {
  std::array<float, 3> normal;
  std::array<float, 6> uvs;
  float emission;
  float texels_per_m;
  std::int32_t object;
  std::int32_t first_level;
  std::int32_t level_count;
};

/// The triangles of a home and their textures.
class Surfaces {
 public:
  /// Copies the arrays.
  /// @throws std::invalid_argument  if there is no triangle, a level is empty, the texels are not
  ///   those of the levels, or a triangle names a level that is not there.
  Surfaces(const TriangleArrays& triangles, const TextureArrays& textures);

  const std::vector<Triangle>& triangles() const { return triangles_; }

  /// Interpolates between the texels and between the levels of a triangle's texture.
  ///
  /// @param second, third  Barycentric weights of these corners.
  /// @param level  See `mip_levels`.
  /// @return  Linear RGB, 0 to 1, and a 0.
  Eigen::Array4f sample(const Triangle& triangle, float second, float third, float level) const;

 private:
  struct Level {
    std::int64_t offset;
    std::int32_t width, height;
  };

  Eigen::Array4f bilinear(const Level& level, float u, float v) const;

  std::vector<Triangle> triangles_;
  std::vector<Level> levels_;
  std::vector<std::uint32_t> texels_;
  /// Linear light of the bytes of a texel, each at its place among red, green and blue; a sum of
  /// three makes a colour.
  std::array<std::array<Eigen::Array4f, 256>, 3> linear_;
};

/// Computes which level of a texture has texels of the size of a pixel, between two if need be.
///
/// @param texels  [N] texels of the largest level along a pixel.
/// @param last  [N] the smallest level.
/// @param levels  [N] are written: 0 to `last`.
void mip_levels(const float* texels, const float* last, std::size_t count, float* levels);

}  // namespace gslts::sim
