#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "gslts/sim/pixel_rays.hpp"
#include "gslts/sim/sensor.hpp"
#include "gslts/sim/shading.hpp"
#include "gslts/sim/surfaces.hpp"
#include "gslts/sim/triangle_hits.hpp"
#include "gslts/sim/visible_triangles.hpp"

namespace gslts::python {
namespace {

using sim::AreaLight;
using sim::Hits;
using sim::Shading;
using sim::Surfaces;

Surfaces surfaces_of(const py::array& normals, const py::array& objects, const py::array& emission,
                     const py::array& uvs, const py::array& texels_per_m,
                     const py::array& first_level, const py::array& level_count,
                     const py::array& level_sizes, const py::array& texels,
                     const py::array& linear_of_byte) {
  const float* vectors = require_array<float>(normals, "normals", {kAnyLength, 3});
  const py::ssize_t size = normals.shape(0);
  const auto* sizes = require_array<std::int32_t>(level_sizes, "level_sizes", {kAnyLength, 2});
  const auto* numbers = require_array<std::uint32_t>(texels, "texels", {kAnyLength});
  return Surfaces(
      {std::size_t(size), vectors, require_array<std::int32_t>(objects, "objects", {size}),
       require_array<float>(emission, "emission", {size}),
       require_array<float>(uvs, "uvs", {size, 3, 2}),
       require_array<float>(texels_per_m, "texels_per_m", {size}),
       require_array<std::int32_t>(first_level, "first_level", {size}),
       require_array<std::int32_t>(level_count, "level_count", {size})},
      {std::size_t(level_sizes.shape(0)), sizes, std::size_t(texels.shape(0)), numbers,
       require_array<float>(linear_of_byte, "linear_of_byte", {256})});
}

/// Lights from [L,4,3].
std::vector<AreaLight> lights_of(const py::array& lights) {
  const double* numbers = require_array<double>(lights, "lights", {kAnyLength, 4, 3});
  std::vector<AreaLight> result;
  for (py::ssize_t k = 0; k < lights.shape(0); ++k, numbers += 12) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 4>> columns(numbers);
    result.push_back({columns.col(0), columns.col(1), columns.col(2), columns.col(3)});
  }
  return result;
}

/// Shading and the size of its image.
struct SizedShading {
  py::ssize_t height, width;
  Shading shading;
};

SizedShading shading_of(const Surfaces& surfaces, const py::array& rays, const py::array& depth,
                        const py::array& triangles, const py::array& weights, float pixel_rad,
                        const py::array& lights, int threads) {
  const float* origins = require_array<float>(rays, "rays", {kAnyLength, kAnyLength, 6});
  const py::ssize_t height = rays.shape(0), width = rays.shape(1);
  const Hits hits{int(width),
                  int(height),
                  pixel_rad,
                  origins,
                  require_array<float>(depth, "depth", {height, width}),
                  require_array<std::uint32_t>(triangles, "triangles", {height, width}),
                  require_array<float>(weights, "weights", {height, width, 2})};
  const std::vector<AreaLight> shining = lights_of(lights);
  const py::gil_scoped_release release;
  return {height, width, Shading(surfaces, hits, shining, threads)};
}

/// A view of an array that `owner` keeps alive.
template <typename T>
py::array_t<T> view_of(const Array<T>& elements, const std::vector<py::ssize_t>& shape,
                       const py::object& owner) {
  return py::array_t<T>(shape, elements.data(), owner);
}

py::array_t<float> radiance(const SizedShading& self, const py::array& blocked,
                            const Eigen::Vector3d& ambient) {
  const auto count = py::ssize_t(self.shading.shadow_rays().size() / 6);
  const bool* hidden = require_array<bool>(blocked, "blocked", {count});
  Array<float> result = [&] {
    const py::gil_scoped_release release;
    return self.shading.radiance(reinterpret_cast<const std::uint8_t*>(hidden), ambient);
  }();
  return to_numpy(std::move(result), {self.height, self.width, 3});
}

py::array_t<float> pixel_rays(const Camera& camera, int threads) {
  Array<float> rays = [&] {
    const py::gil_scoped_release release;
    return sim::pixel_rays(camera, threads);
  }();
  return to_numpy(std::move(rays), {camera.height, camera.width, 6});
}

py::array_t<std::uint32_t> visible_triangles(const Camera& camera, const py::array& corners,
                                             int threads) {
  const float* triangles = require_array<float>(corners, "corners", {kAnyLength, 3, 3});
  Array<std::uint32_t> indices = [&] {
    const py::gil_scoped_release release;
    return sim::visible_triangles(camera, triangles, std::size_t(corners.shape(0)), threads);
  }();
  return to_numpy(std::move(indices), {camera.height, camera.width});
}

py::tuple intersect_triangles(const py::array& rays, const py::array& hit, const py::array& corners,
                              int threads) {
  const auto* indices = require_array<std::uint32_t>(hit, "hit", {kAnyLength});
  const py::ssize_t size = hit.shape(0);
  const float* numbers = require_array<float>(rays, "rays", {size, 6});
  const float* triangles = require_array<float>(corners, "corners", {kAnyLength, 3, 3});
  sim::TriangleHits hits = [&] {
    const py::gil_scoped_release release;
    return sim::intersect_triangles(
        {std::size_t(size), numbers, indices, std::size_t(corners.shape(0)), triangles}, threads);
  }();
  return py::make_tuple(to_numpy(std::move(hits.distance), {size}),
                        to_numpy(std::move(hits.weights), {size, 2}));
}

py::array_t<std::uint8_t> measure_color(const py::array& radiance,
                                        const std::optional<py::array>& normals,
                                        const std::array<double, 3>& gains, double vignetting,
                                        double noise_std, int threads) {
  const double* light = require_array<double>(radiance, "radiance", {kAnyLength, kAnyLength, 3});
  const py::ssize_t height = radiance.shape(0), width = radiance.shape(1);
  const double* noise =
      normals ? require_array<double>(*normals, "normals", {height, width, 3}) : nullptr;
  Array<std::uint8_t> rgb = [&] {
    const py::gil_scoped_release release;
    return sim::measure_color(light, noise, int(width), int(height), {gains, vignetting, noise_std},
                              threads);
  }();
  return to_numpy(std::move(rgb), {height, width, 3});
}

py::array_t<float> measure_depth(const py::array& depth, const py::array& cosines,
                                 const py::array& normals, const py::array& uniforms, double std_m,
                                 double std_per_m, const std::array<double, 2>& range_m,
                                 double least_cosine, double edge_dropout, double dropout,
                                 int threads) {
  const float* truth = require_array<float>(depth, "depth", {kAnyLength, kAnyLength});
  const py::ssize_t height = depth.shape(0), width = depth.shape(1);
  const float* facing = require_array<float>(cosines, "cosines", {height, width});
  const double* noise = require_array<double>(normals, "normals", {height, width});
  const double* luck = require_array<double>(uniforms, "uniforms", {height, width});
  Array<float> measured = [&] {
    const py::gil_scoped_release release;
    return sim::measure_depth(
        truth, facing, noise, luck, int(width), int(height),
        {std_m, std_per_m, range_m[0], range_m[1], least_cosine, edge_dropout, dropout}, threads);
  }();
  return to_numpy(std::move(measured), {height, width});
}

void define_sensor(py::module_& m) {
  m.def("measure_color", &measure_color, py::arg("radiance"), py::kw_only(), py::arg("normals"),
        py::arg("gains"), py::arg("vignetting"), py::arg("noise_std"),
        py::arg("threads").noconvert(),
        R"(Makes an sRGB image (IEC 61966-2-1) of linear light.

Args:
    radiance: [H,W,3] float64, linear RGB.
    normals: [H,W,3] float64, standard normal numbers, the noise; None: there is none.
    gains: Factors of red, green and blue.
    vignetting: Share of the light that is lost in the corners.
    noise_std: Of the noise of each number of the image, 0 to 1.
    threads: 0 means one per hardware thread; the result does not depend on it.

Returns:
    [H,W,3] uint8

Raises:
    ValueError: An array does not fit, or threads is negative.)");
  m.def("measure_depth", &measure_depth, py::arg("depth"), py::arg("cosines"), py::kw_only(),
        py::arg("normals"), py::arg("uniforms"), py::arg("std_m"), py::arg("std_per_m"),
        py::arg("range_m"), py::arg("least_cosine"), py::arg("edge_dropout"), py::arg("dropout"),
        py::arg("threads").noconvert(),
        R"(Makes a depth image with noise and holes.

Args:
    depth: [H,W] float32, true depth, m; 0 where nothing is.
    cosines: [H,W] float32, between surface normal and ray.
    normals: [H,W] float64, standard normal numbers.
    uniforms: [H,W] float64 in 0 to 1, which decide the dropout.
    std_m: Of the noise at any depth, m.
    std_per_m: Growth of that with the squared depth, m/m^2.
    range_m: Nearest and farthest depth that is measured, m.
    least_cosine: Surfaces at a smaller cosine to the ray give no depth.
    edge_dropout: Probability that a pixel at an edge of the depth gives none.
    dropout: Probability that any other pixel gives none.
    threads: 0 means one per hardware thread; the result does not depend on it.

Returns:
    [H,W] float32, m; 0 where nothing is measured.

Raises:
    ValueError: An array does not fit, or threads is negative.)");
}

void define_shading(py::module_& m) {
  py::class_<SizedShading>(m, "Shading", R"(An image under area lights, in two steps.

Between them, the caller casts the shadow rays.

Args:
    surfaces: What the rays hit.
    rays: [H,W,6] float32, as from `pixel_rays`.
    depth: [H,W] float32, m along them, infinite where nothing is hit.
    triangles: [H,W] uint32, what is hit.
    weights: [H,W,2] float32, barycentric weights of its second and third corner.
    pixel_rad: Angle of a pixel, 1 / focal length.
    lights: [L,4,3] float64, center, edge_u, edge_v (m) and radiance of each.
    threads: 0 means one per hardware thread; the result does not depend on it.

Raises:
    ValueError: An array does not fit, a hit names a triangle that is not there, or threads is
        negative.)")
      .def(py::init(&shading_of), py::arg("surfaces"), py::arg("rays"), py::arg("depth"),
           py::arg("triangles"), py::arg("weights"), py::kw_only(), py::arg("pixel_rad"),
           py::arg("lights"), py::arg("threads").noconvert(), py::keep_alive<1, 2>(),
           py::keep_alive<1, 3>(), py::keep_alive<1, 4>(), py::keep_alive<1, 5>(),
           py::keep_alive<1, 6>())
      .def_property_readonly(
          "shadow_rays",
          [](const py::object& self) {
            const Array<float>& rays = self.cast<const SizedShading&>().shading.shadow_rays();
            return view_of(rays, {py::ssize_t(rays.size() / 6), 6}, self);
          },
          "[R,6] float32 origins, m, and ways to the lights; what blocks them is in 0 to 1.")
      .def_property_readonly(
          "depth",
          [](const py::object& self) {
            const auto& s = self.cast<const SizedShading&>();
            return view_of(s.shading.depth(), {s.height, s.width}, self);
          },
          "[H,W] float32, m; 0 where nothing was hit.")
      .def_property_readonly(
          "cosines",
          [](const py::object& self) {
            const auto& s = self.cast<const SizedShading&>();
            return view_of(s.shading.cosines(), {s.height, s.width}, self);
          },
          "[H,W] float32, between normal and ray; 0 where nothing was hit.")
      .def_property_readonly(
          "objects",
          [](const py::object& self) {
            const auto& s = self.cast<const SizedShading&>();
            return view_of(s.shading.objects(), {s.height, s.width}, self);
          },
          "[H,W] int32, index; -1 where nothing was hit.")
      .def("radiance", &radiance, py::arg("blocked"), py::arg("ambient"),
           R"(Computes the image.

Args:
    blocked: [R] bool, whether anything is in the way of each shadow ray.
    ambient: (3,) linear RGB of the light that is everywhere.

Returns:
    [H,W,3] float32, linear RGB; 0 where nothing was hit.

Raises:
    ValueError: An array does not fit.)");
}

}  // namespace

void define_sim(py::module_ m) {
  py::class_<Surfaces>(m, "Surfaces", R"(The T triangles of a home and their textures; copies.

Args:
    normals: [T,3] float32, unit vectors, world.
    objects: [T] int32, index of the object that each belongs to.
    emission: [T] float32, radiance of a white texel that glows.
    uvs: [T,3,2] float32, texture coordinates of the corners.
    texels_per_m: [T] float32, on the largest level of the texture.
    first_level: [T] int32, index of that level.
    level_count: [T] int32, number of levels, each half as large.
    level_sizes: [L,2] int32, height and width, px.
    texels: [X] uint32, all levels one after the other, red + 256 green + 65536 blue.
    linear_of_byte: [256] float32, linear light of an sRGB byte.

Raises:
    ValueError: An array does not fit, or a triangle names a level that is not there.)")
      .def(py::init(&surfaces_of), py::kw_only(), py::arg("normals"), py::arg("objects"),
           py::arg("emission"), py::arg("uvs"), py::arg("texels_per_m"), py::arg("first_level"),
           py::arg("level_count"), py::arg("level_sizes"), py::arg("texels"),
           py::arg("linear_of_byte"));
  define_shading(m);
  define_sensor(m);
  m.def("pixel_rays", &pixel_rays, py::arg("camera"), py::kw_only(), py::arg("threads").noconvert(),
        R"(Makes the rays from the eye of a camera through the centres of its pixels.

Returns:
    [H,W,6] float32: origin, m, and direction in world axes, whose z in the camera frame is 1.

Raises:
    ValueError: threads is negative.)");
  m.def("visible_triangles", &visible_triangles, py::arg("camera"), py::arg("corners"),
        py::kw_only(), py::arg("threads").noconvert(),
        R"(Finds the nearest triangle in front of a camera at each pixel centre, by rasterization.

Args:
    camera: The camera.
    corners: [T,3,3] float32, m, world. Both sides of a triangle are visible.
    threads: 0 means one per hardware thread; the result does not depend on it.

Returns:
    [H,W] uint32 index, the lower of two at the same distance; 0xffffffff where nothing is hit.

Raises:
    ValueError: An array does not fit, or threads is negative.)");
  m.def("intersect_triangles", &intersect_triangles, py::arg("rays"), py::arg("hit"),
        py::arg("corners"), py::kw_only(), py::arg("threads").noconvert(),
        R"(Computes where rays meet triangles that are known to be hit, the same on every processor.

Args:
    rays: [N,6] float32 origins, m, and directions of any length, world.
    hit: [N] uint32 index of the triangle; 0xffffffff where nothing is hit.
    corners: [T,3,3] float32, m, world.
    threads: 0 means one per hardware thread; the result does not depend on it.

Returns:
    Distances [N] float32 in lengths of the direction, infinite for a miss; and barycentric weights
    [N,2] float32 of the second and third corner.

Raises:
    ValueError: An array does not fit, an index is out of range, or threads is negative.)");
}

}  // namespace gslts::python
