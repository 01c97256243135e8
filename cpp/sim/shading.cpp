#include "gslts/sim/shading.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

/// Light samples differ in tiles of 4 x 4 pixels and are averaged over them afterwards.
constexpr std::size_t kPattern = 4;
/// Shadow rays start this far off the surface, so that it does not shade itself.
constexpr float kShadowOffsetM = 1e-3f;
/// Light is averaged over pixels whose normals have this cosine at least,
constexpr float kSameNormal = 0.9f;
/// and whose depths differ by this share at most for each pixel between them.
constexpr float kSameDepth = 0.02f;
/// Neighbours over which light is averaged: with the pixel itself, one tile of the pattern.
constexpr int kShifts[] = {-2, -1, 1};
/// Grazing surfaces take the smaller texture of this cosine, and not one texel for all.
constexpr float kLeastCosine = 0.1f;

// The order of each sum below is part of the result. Row pointers are __restrict, because the loops
// become vector code only if what they write is known to be apart from what they read.

/// The coordinates of a vector in each pixel of a row.
struct Row {
  const float* __restrict x;
  const float* __restrict y;
  const float* __restrict z;
};

Row row_of(const std::array<Array<float>, 3>& planes, std::size_t first) {
  return {planes[0].data() + first, planes[1].data() + first, planes[2].data() + first};
}

/// Writes 1 where a pixel and its neighbour show one surface, 0 elsewhere.
void same_surface(Row a, Row b, const float* __restrict depth_a, const float* __restrict depth_b,
                  float share, std::size_t count, float* __restrict same) {
  for (std::size_t i = 0; i < count; ++i) {
    const float cosine = a.x[i] * b.x[i] + a.y[i] * b.y[i] + a.z[i] * b.z[i];
    const float step = std::abs(depth_a[i] - depth_b[i]);
    same[i] = (cosine > kSameNormal) & (step < share * depth_a[i]) ? 1.0f : 0.0f;
  }
}

void add_weighted(const float* __restrict values, const float* __restrict weights,
                  std::size_t count, float* __restrict total) {
  for (std::size_t i = 0; i < count; ++i) total[i] += values[i] * weights[i];
}

void add(const float* __restrict values, std::size_t count, float* __restrict total) {
  for (std::size_t i = 0; i < count; ++i) total[i] += values[i];
}

void divide(const float* __restrict weights, std::size_t count, float* __restrict values) {
  for (std::size_t i = 0; i < count; ++i) values[i] /= weights[i];
}

/// Turns the normals of a row towards the camera and writes the cosines between both.
void face_camera(Row rays, std::size_t count, float* __restrict x, float* __restrict y,
                 float* __restrict z, float* __restrict cosines) {
  for (std::size_t i = 0; i < count; ++i) {
    const float squared = rays.x[i] * rays.x[i] + rays.y[i] * rays.y[i] + rays.z[i] * rays.z[i];
    const float dot = x[i] * rays.x[i] + y[i] * rays.y[i] + z[i] * rays.z[i];
    const float cosine = dot / std::sqrt(squared);
    const float sign = cosine > 0 ? -1.0f : 1.0f;
    x[i] *= sign;
    y[i] *= sign;
    z[i] *= sign;
    cosines[i] = std::abs(cosine);
  }
}

}  // namespace

Shading::Light Shading::prepared(const AreaLight& light) {
  constexpr int kOrder[] = {0, 2, 3, 1};  // Pixels next to each other see points far apart.
  const Vector3d cross = light.edge_u.cross(light.edge_v);
  const double area =
      std::sqrt(cross.x() * cross.x() + cross.y() * cross.y() + cross.z() * cross.z());
  const Vector3f center = light.center.cast<float>();
  const Vector3f edge_u = light.edge_u.cast<float>(), edge_v = light.edge_v.cast<float>();
  Light result{{},
               (cross / area).cast<float>(),
               light.radiance.cast<float>(),
               float(area / 3.14159265358979323846)};
  for (std::size_t row = 0; row < kPattern; ++row) {
    for (std::size_t column = 0; column < kPattern; ++column) {
      const int i = kOrder[row], j = kOrder[column];
      const float u = (float(i) + 0.5f) / 4 - 0.5f, v = (float((i + j) % 4) + 0.5f) / 4 - 0.5f;
      for (int k = 0; k < 3; ++k) {
        result.points[row][column][k] = center[k] + u * edge_u[k] + v * edge_v[k];
      }
    }
  }
  return result;
}

Shading::Shading(const Surfaces& surfaces, const Hits& hits, const std::vector<AreaLight>& lights,
                 int threads)
    : surfaces_(surfaces), hits_(hits), threads_(threads) {
  if (hits.width < 1 || hits.height < 1) {
    throw std::invalid_argument("Shading: the size must be positive, got " +
                                std::to_string(hits.width) + " x " + std::to_string(hits.height));
  }
  for (const AreaLight& light : lights) lights_.push_back(prepared(light));
  const auto width = std::size_t(hits.width), height = std::size_t(hits.height);
  const std::size_t pixels = width * height;
  for (Array<float>& plane : normals_) plane.resize(pixels);
  depth_.resize(pixels);
  cosines_.resize(pixels);
  objects_.resize(pixels);
  albedo_.resize(pixels);
  emission_.resize(pixels);
  factors_.resize(lights_.size() * pixels);
  first_ray_.assign(height + 1, 0);
  parallel::parallel_for(height, threads, [&](std::size_t row) {
    look_up_row(row);
    float* factors = factors_.data() + row * lights_.size() * width;
    for (std::size_t k = 0; k < lights_.size(); ++k) {
      light_row(row, lights_[k], factors + k * width);
    }
    const auto none = std::count(factors, factors + lights_.size() * width, 0.0f);
    first_ray_[row + 1] = lights_.size() * width - std::size_t(none);
  });
  for (std::size_t row = 0; row < height; ++row) first_ray_[row + 1] += first_ray_[row];
  shadow_rays_.resize(6 * first_ray_[height]);
  parallel::parallel_for(height, threads, [&](std::size_t row) { write_shadow_rays(row); });
}

void Shading::look_up_row(std::size_t row) {
  const auto width = std::size_t(hits_.width);
  const std::size_t first = row * width;
  const std::vector<Triangle>& triangles = surfaces_.triangles();
  std::vector<float> buffer(6 * width);
  float* ways = buffer.data();
  float *texels = ways + 3 * width, *last = texels + width, *levels = last + width;
  for (std::size_t i = 0; i < width; ++i) {
    const float* ray = hits_.rays + 6 * (first + i);
    for (std::size_t k = 0; k < 3; ++k) ways[k * width + i] = ray[3 + k];
    const float depth = hits_.depth[first + i];
    const bool hit = std::isfinite(depth);
    const std::uint32_t index = hits_.triangles[first + i];
    if (hit && index >= triangles.size()) {
      throw std::invalid_argument("Shading: there is no triangle " + std::to_string(index));
    }
    // A miss has no normal: no light arrives, and no neighbour takes it for its own surface.
    const Triangle* triangle = hit ? &triangles[index] : nullptr;
    depth_[first + i] = hit ? depth : 0.0f;
    objects_[first + i] = hit ? triangle->object : -1;
    texels[i] = hit ? triangle->texels_per_m : 0.0f;
    last[i] = hit ? float(triangle->level_count - 1) : 0.0f;
    emission_[first + i] = hit ? triangle->emission : 0.0f;
    for (std::size_t k = 0; k < 3; ++k) normals_[k][first + i] = hit ? triangle->normal[k] : 0.0f;
  }
  float* cosines = cosines_.data() + first;
  face_camera({ways, ways + width, ways + 2 * width}, width, normals_[0].data() + first,
              normals_[1].data() + first, normals_[2].data() + first, cosines);
  for (std::size_t i = 0; i < width; ++i) {
    const float cosine = cosines[i] > kLeastCosine ? cosines[i] : kLeastCosine;
    texels[i] = depth_[first + i] * hits_.pixel_rad / cosine * texels[i];
  }
  mip_levels(texels, last, width, levels);
  for (std::size_t i = 0; i < width; ++i) {
    if (objects_[first + i] < 0) {
      albedo_[first + i].setZero();
      continue;
    }
    const float* weights = hits_.weights + 2 * (first + i);
    albedo_[first + i] =
        surfaces_.sample(triangles[hits_.triangles[first + i]], weights[0], weights[1], levels[i]);
  }
}

void Shading::start_points(std::size_t row, float* __restrict x, float* __restrict y,
                           float* __restrict z) const {
  const auto width = std::size_t(hits_.width);
  const float* depth = depth_.data() + row * width;
  const Row normals = row_of(normals_, row * width);
  for (std::size_t i = 0; i < width; ++i) {
    const float* ray = hits_.rays + 6 * (row * width + i);
    x[i] = ray[0] + ray[3] * depth[i] + kShadowOffsetM * normals.x[i];
    y[i] = ray[1] + ray[4] * depth[i] + kShadowOffsetM * normals.y[i];
    z[i] = ray[2] + ray[5] * depth[i] + kShadowOffsetM * normals.z[i];
  }
}

void Shading::light_row(std::size_t row, const Light& light, float* __restrict factors) const {
  const auto width = std::size_t(hits_.width);
  std::vector<float> buffer(3 * width);
  float* __restrict x = buffer.data(), * __restrict y = x + width, * __restrict z = y + width;
  start_points(row, x, y, z);
  // From here on the way to the light's point.
  const auto& points = light.points[row % kPattern];
  for (std::size_t i = 0; i < width; ++i) {
    const Vector3f& point = points[i % kPattern];
    x[i] = point[0] - x[i];
    y[i] = point[1] - y[i];
    z[i] = point[2] - z[i];
  }
  const Row normals = row_of(normals_, row * width);
  const float nx = light.normal[0], ny = light.normal[1], nz = light.normal[2];
  const float scale = light.scale;
  for (std::size_t i = 0; i < width; ++i) {
    // Lambert's law at both ends; the solid angle of a half-space, seen by cosine, is pi.
    const float here = x[i] * normals.x[i] + y[i] * normals.y[i] + z[i] * normals.z[i];
    const float there = -(x[i] * nx + y[i] * ny + z[i] * nz);
    const float squared = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
    const float fourth = squared * squared;
    const float lambert = (here > 0 ? here : 0.0f) * (there > 0 ? there : 0.0f);
    factors[i] = lambert * scale / (fourth > 1e-6f ? fourth : 1e-6f);
  }
}

void Shading::write_shadow_rays(std::size_t row) {
  const auto width = std::size_t(hits_.width);
  std::vector<float> start(3 * width);
  start_points(row, start.data(), start.data() + width, start.data() + 2 * width);
  const float* factor = factors_.data() + row * lights_.size() * width;
  float* ray = shadow_rays_.data() + 6 * first_ray_[row];
  for (const Light& light : lights_) {
    const auto& points = light.points[row % kPattern];
    for (std::size_t i = 0; i < width; ++i, ++factor) {
      if (*factor == 0) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        ray[k] = start[k * width + i];
        ray[3 + k] = points[i % kPattern][Eigen::Index(k)] - ray[k];
      }
      ray += 6;
    }
  }
}

Array<float> Shading::radiance(const std::uint8_t* blocked, const Vector3d& ambient) const {
  const auto width = std::size_t(hits_.width), height = std::size_t(hits_.height);
  Planes direct;
  for (Array<float>& plane : direct) plane.resize(width * height);
  parallel::parallel_for(height, threads_, [&](std::size_t row) {
    direct_row(row, blocked + first_ray_[row], direct);
  });
  Array<float> result(3 * width * height);
  const Vector3f everywhere = ambient.cast<float>();
  parallel::parallel_for(height, threads_, [&](std::size_t row) {
    radiance_row(row, direct, everywhere, result.data() + 3 * row * width);
  });
  return result;
}

/// Light of the lights in a row, averaged along it.
void Shading::direct_row(std::size_t row, const std::uint8_t* blocked, Planes& direct) const {
  const auto width = std::size_t(hits_.width);
  const std::size_t first = row * width;
  std::vector<float> buffer(5 * width);
  float *factor = buffer.data(), *same = factor + width, *light_rgb = same + width;
  const float* may_arrive = factors_.data() + first * lights_.size();
  for (const Light& light : lights_) {
    for (std::size_t i = 0; i < width; ++i, ++may_arrive) {
      factor[i] = *may_arrive != 0 && *blocked++ == 0 ? *may_arrive : 0.0f;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const float radiance = light.radiance[Eigen::Index(k)];
      float* sum = light_rgb + k * width;
      for (std::size_t i = 0; i < width; ++i) sum[i] += factor[i] * radiance;
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    std::copy_n(light_rgb + k * width, width, direct[k].data() + first);
  }
  float* weight = factor;
  std::fill_n(weight, width, 1.0f);
  for (const int shift : kShifts) {
    const std::size_t distance = std::size_t(std::abs(shift));
    if (distance >= width) continue;
    const std::size_t here = shift < 0 ? distance : 0, there = shift < 0 ? 0 : distance;
    const std::size_t count = width - distance;
    same_surface(row_of(normals_, first + here), row_of(normals_, first + there),
                 depth_.data() + first + here, depth_.data() + first + there,
                 kSameDepth * float(distance), count, same);
    for (std::size_t k = 0; k < 3; ++k) {
      add_weighted(light_rgb + k * width + there, same, count, direct[k].data() + first + here);
    }
    add(same, count, weight + here);
  }
  for (std::size_t k = 0; k < 3; ++k) divide(weight, width, direct[k].data() + first);
}

/// Radiance of a row, from light that is averaged along each row, by averaging along the columns.
void Shading::radiance_row(std::size_t row, const Planes& direct, const Vector3f& ambient,
                           float* radiance) const {
  const auto width = std::size_t(hits_.width);
  const std::size_t first = row * width;
  std::vector<float> buffer(5 * width);
  float *weight = buffer.data(), *same = weight + width, *light = same + width;
  std::fill_n(weight, width, 1.0f);
  for (std::size_t k = 0; k < 3; ++k)
    std::copy_n(direct[k].data() + first, width, light + k * width);
  for (const int shift : kShifts) {
    const auto other = std::ptrdiff_t(row) + shift;
    if (other < 0 || other >= hits_.height) continue;
    const std::size_t there = std::size_t(other) * width;
    same_surface(row_of(normals_, first), row_of(normals_, there), depth_.data() + first,
                 depth_.data() + there, kSameDepth * float(std::abs(shift)), width, same);
    for (std::size_t k = 0; k < 3; ++k) {
      add_weighted(direct[k].data() + there, same, width, light + k * width);
    }
    add(same, width, weight);
  }
  const Eigen::Array4f* albedo = albedo_.data() + first;
  for (std::size_t k = 0; k < 3; ++k) {
    float* __restrict rgb = light + k * width;
    divide(weight, width, rgb);
    const float* __restrict emission = emission_.data() + first;
    const float everywhere = ambient[Eigen::Index(k)];
    for (std::size_t i = 0; i < width; ++i) rgb[i] = rgb[i] + everywhere + emission[i];
    for (std::size_t i = 0; i < width; ++i)
      radiance[3 * i + k] = albedo[i][Eigen::Index(k)] * rgb[i];
  }
}

}  // namespace gslts::sim
