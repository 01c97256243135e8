#include "gslts/sim/surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

namespace gslts::sim {
namespace {

using Eigen::Array4f;

/// The logarithm of a positive normal number, to base 2, rounded from double: that of the C library
/// has other last bits on other machines. Without a branch, so that a loop becomes vector code.
inline float log2_of(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  // The mantissa is taken from sqrt(1/2) to sqrt(2), where the series below is shortest.
  constexpr std::uint32_t kSqrtHalf = 0x3f3504f3;
  const std::int32_t exponent = std::int32_t(bits - kSqrtHalf) >> 23;
  bits -= std::uint32_t(exponent) << 23;
  float mantissa;
  std::memcpy(&mantissa, &bits, sizeof mantissa);
  // log2(m) = 2/ln(2) * artanh((m - 1) / (m + 1)); |s| < 0.172, so that the next term is below
  // 1e-13.
  const double s = (double(mantissa) - 1) / (double(mantissa) + 1), q = s * s;
  const double series =
      1 + q * (1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11 + q / 13)))));
  return float(double(exponent) + 2.8853900817779268 * (s * series));
}

/// The remainder, at least 0, of a whole number divided by a positive one. Beyond 2^31 a float
/// tells texels no longer apart, and the first one stands for all.
std::int32_t wrapped(float value, std::int32_t size) {
  if (!(std::abs(value) < 2147483648.0f)) return 0;
  const auto whole = std::int32_t(value);
  if (whole >= 0 && whole < size) return whole;
  const std::int32_t rest = whole % size;
  return rest < 0 ? rest + size : rest;
}

std::invalid_argument error(const std::string& what) {
  return std::invalid_argument("Surfaces: " + what);
}

}  // namespace

Surfaces::Surfaces(const TriangleArrays& triangles, const TextureArrays& textures)
    : texels_(textures.texels, textures.texels + textures.texel_count) {
  for (Eigen::Index k = 0; k < 3; ++k) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      linear_[std::size_t(k)][byte].setZero();
      linear_[std::size_t(k)][byte][k] = textures.linear_of_byte[byte];
    }
  }
  std::int64_t end = 0;
  for (std::size_t k = 0; k < textures.level_count; ++k) {
    const std::int32_t height = textures.sizes[2 * k], width = textures.sizes[2 * k + 1];
    if (height < 1 || width < 1) throw error("level " + std::to_string(k) + " has no texel");
    levels_.push_back({end, width, height});
    end += std::int64_t(width) * height;
  }
  if (std::size_t(end) != textures.texel_count) {
    throw error("expected " + std::to_string(end) + " texels, got " +
                std::to_string(textures.texel_count));
  }
  if (triangles.size == 0) throw error("there is no triangle");
  triangles_.resize(triangles.size);
  for (std::size_t i = 0; i < triangles.size; ++i) {
    Triangle& triangle = triangles_[i];
    std::copy_n(triangles.normals + 3 * i, 3, triangle.normal.begin());
    std::copy_n(triangles.uvs + 6 * i, 6, triangle.uvs.begin());
    triangle.emission = triangles.emission[i];
    triangle.texels_per_m = triangles.texels_per_m[i];
    triangle.object = triangles.objects[i];
    triangle.first_level = triangles.first_level[i];
    triangle.level_count = triangles.level_count[i];
    if (triangle.first_level < 0 || triangle.level_count < 1 ||
        std::int64_t(triangle.first_level) + triangle.level_count > std::int64_t(levels_.size())) {
      throw error("triangle " + std::to_string(i) + " has levels that are not there");
    }
  }
}

inline Array4f Surfaces::bilinear(const Level& level, float u, float v) const {
  const std::int32_t width = level.width, height = level.height;
  const float x = u * float(width) - 0.5f, y = v * float(height) - 0.5f;
  const float column = std::floor(x), row = std::floor(y);
  const float right = x - column, down = y - row;
  const std::int32_t left = wrapped(column, width), upper = wrapped(row, height);
  const std::int32_t next = left + 1 == width ? 0 : left + 1;
  const std::uint32_t* texels = texels_.data() + level.offset;
  const std::uint32_t* above = texels + std::int64_t(upper) * width;
  const std::uint32_t* below = texels + std::int64_t(upper + 1 == height ? 0 : upper + 1) * width;
  const auto color = [&](std::uint32_t texel) -> Array4f {
    return linear_[0][texel & 255] + linear_[1][texel >> 8 & 255] + linear_[2][texel >> 16 & 255];
  };
  const Array4f upper_left = color(above[left]), lower_left = color(below[left]);
  const Array4f upper_color = upper_left + right * (color(above[next]) - upper_left);
  const Array4f lower_color = lower_left + right * (color(below[next]) - lower_left);
  return upper_color + down * (lower_color - upper_color);
}

Array4f Surfaces::sample(const Triangle& triangle, float second, float third, float level) const {
  const std::array<float, 6>& c = triangle.uvs;
  const float u = c[0] + second * (c[2] - c[0]) + third * (c[4] - c[0]);
  const float v = c[1] + second * (c[3] - c[1]) + third * (c[5] - c[1]);
  const Level* levels = levels_.data() + triangle.first_level;
  const int lower = int(level);
  const Array4f near = bilinear(levels[lower], u, v);
  const float beyond = level - float(lower);
  if (beyond == 0) return near;
  return near + beyond * (bilinear(levels[lower + 1], u, v) - near);
}

void mip_levels(const float* __restrict texels, const float* __restrict last, std::size_t count,
                float* __restrict levels) {
  for (std::size_t i = 0; i < count; ++i) {
    const float level = log2_of(texels[i] > 1 ? texels[i] : 1.0f);
    levels[i] = level < last[i] ? level : last[i];
  }
}

}  // namespace gslts::sim
