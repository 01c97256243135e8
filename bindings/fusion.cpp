#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <cstdint>
#include <optional>
#include <utility>

#include "arrays.hpp"
#include "exclusive_use.hpp"
#include "gslts/fusion/register_depth.hpp"
#include "gslts/fusion/surface_voxels.hpp"

namespace gslts::python {
namespace {

using fusion::kVoxelSums;
using fusion::VoxelSums;

/// `fusion::SurfaceVoxels` that works without the GIL, so it rejects a second thread.
struct SurfaceVoxels : fusion::SurfaceVoxels {
  using fusion::SurfaceVoxels::SurfaceVoxels;
  bool in_use = false;
};

void add(SurfaceVoxels& voxels, const py::array& depth, const py::array& rgb, const Camera& camera,
         const std::optional<py::array>& mask) {
  const py::ssize_t height = camera.height, width = camera.width;
  const auto* measured = require_array<float>(depth, "depth", {height, width});
  const auto* colors = require_array<std::uint8_t>(rgb, "rgb", {height, width, 3});
  const bool* seen = mask ? require_array<bool>(*mask, "mask", {height, width}) : nullptr;
  const ExclusiveUse use(voxels.in_use, "SurfaceVoxels");
  const py::gil_scoped_release release;
  voxels.add(measured, colors, camera, reinterpret_cast<const std::uint8_t*>(seen));
}

using Sums =
    py::typing::Tuple<py::array_t<std::int64_t>, py::array_t<double>, py::array_t<std::int64_t>>;

Sums voxels_of(SurfaceVoxels& surface) {
  const ExclusiveUse use(surface.in_use, "SurfaceVoxels");
  VoxelSums voxels = [&] {
    const py::gil_scoped_release release;
    return surface.voxels();
  }();
  const auto size = static_cast<py::ssize_t>(voxels.keys.size());
  return py::make_tuple(to_numpy(std::move(voxels.keys), {size}),
                        to_numpy(std::move(voxels.sums), {size, kVoxelSums}),
                        to_numpy(std::move(voxels.hits), {size}));
}

void define_surface_voxels(py::module_& m) {
  py::class_<SurfaceVoxels>(m, "SurfaceVoxels",
                            R"(Fuses depth images: sums of the measured surface points in voxels.

Sums are taken in the order of the frames and of their pixels. RuntimeError is raised where another
thread uses the object.

Args:
    edge_m: Edge of the voxels, whose corners are multiples of it, m.
    pixel_step: Every n-th row and column of an image is used.

Raises:
    ValueError: The edge is not positive and finite, or the step is below 1.)")
      .def(py::init<double, int>(), py::arg("edge_m"), py::arg("pixel_step").noconvert())
      .def("add", &add, py::arg("depth"), py::arg("rgb"), py::arg("camera"), py::arg("mask"),
           R"(Add the points of an image, with normals, colours and details.

A pixel counts if it and its four neighbours, `pixel_step` away, are measured and no edge of the
depth separates them.

Args:
    depth: [H,W] float32, z, m; 0 and NaN mean no measurement.
    rgb: [H,W,3] uint8, sRGB.
    camera: Camera of both images.
    mask: [H,W] bool, False where pixels are invalid; None means that all are valid.

Raises:
    ValueError: An array does not fit, a depth is negative or infinite, the camera is farther from
        the world's origin than 2^40 voxels, or a point is about 2^20 voxels from the first
        camera. Nothing has been added then.)")
      .def("voxels", &voxels_of, R"(Return all V voxels so far, by ascending key.

Returns:
    keys: [V] int64, Morton codes. A voxel of twice the edge has the keys of its eight parts, which
        follow each other, shifted right by 3. Keys depend on where the first camera stood.
    sums: [V,11] float64 over the points of each: their number, position in the world (3, m), unit
        normal towards the camera (3), sRGB colour from 0 to 1 (3), and squared change of the
        brightness along the surface (1/m^2).
    hits: [V] int64, frames with points in the voxel.)");
}

void define_register_depth(py::module_& m) {
  m.def(
      "register_depth",
      [](const py::array& depth, const Camera& depth_camera, const Camera& camera) {
        const float* measured =
            require_array<float>(depth, "depth", {depth_camera.height, depth_camera.width});
        Array<float> registered = [&] {
          const py::gil_scoped_release release;
          return fusion::register_depth(measured, depth_camera, camera);
        }();
        return to_numpy(std::move(registered), {camera.height, camera.width});
      },
      py::arg("depth"), py::arg("depth_camera"), py::arg("camera"),
      R"(Register a depth image to another camera.

Each measured pixel is projected as a small planar patch that it and its neighbours determine, so
that surfaces stay closed and planes stay planes; where patches overlap, the nearest one counts.

Args:
    depth: [H,W] float32 of `depth_camera`, z, m; 0 and NaN mean no measurement.
    depth_camera, camera: Cameras with poses in one frame; only the relative pose counts.

Returns:
    [H',W'] float32 of `camera`, z, m; 0 where no patch is projected.

Raises:
    ValueError: The image does not fit its camera.)");
}

}  // namespace

void define_fusion(py::module_ m) {
  define_surface_voxels(m);
  define_register_depth(m);
}

}  // namespace gslts::python
