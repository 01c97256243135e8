#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "arrays.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/map/scatter_rows.hpp"
#include "poses.hpp"

namespace gslts::python {
namespace {

Camera make_camera(double fx, double fy, double cx, double cy, int width, int height,
                   const py::array& world_from_camera) {
  const Camera camera{
      fx, fy, cx, cy, width, height, to_eigen(world_from_camera, "world_from_camera")};
  validate(camera, "Camera");
  return camera;
}

bool equal(const Camera& a, const Camera& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.width == b.width &&
         a.height == b.height && a.world_from_camera.matrix() == b.world_from_camera.matrix();
}

void define_camera(py::module_& m) {
  py::class_<Camera>(m, "Camera", R"(A pinhole camera at a pose in the world; immutable.

Camera frame: OpenCV axes, x right, y down, z forward, metres. The pixel in column i and row j
covers [i, i+1) x [j, j+1) of the image plane; its centre is (i + 0.5, j + 0.5). A point (x, y, z)
in the camera frame is seen at (fx x/z + cx, fy y/z + cy) pixels.

Args:
    fx, fy: Focal lengths, px.
    cx, cy: Principal point, px.
    width, height: Image size, px.
    world_from_camera: [4,4] float64, rigid transform from the camera frame to the world frame:
        x_in_world = world_from_camera @ x_in_camera. Metres, world z up.

Raises:
    ValueError: A focal length that is not positive, a size outside 1..65536, a rotation that is not
        orthonormal to 1e-6, anything not finite, or a pose of another shape or dtype.)")
      .def(py::init(&make_camera), py::kw_only(), py::arg("fx"), py::arg("fy"), py::arg("cx"),
           py::arg("cy"), py::arg("width").noconvert(), py::arg("height").noconvert(),
           py::arg("world_from_camera"))
      .def_readonly("fx", &Camera::fx, "Horizontal focal length, px.")
      .def_readonly("fy", &Camera::fy, "Vertical focal length, px.")
      .def_readonly("cx", &Camera::cx, "Principal point, column, px.")
      .def_readonly("cy", &Camera::cy, "Principal point, row, px.")
      .def_readonly("width", &Camera::width, "Image width, px.")
      .def_readonly("height", &Camera::height, "Image height, px.")
      .def_property_readonly(
          "world_from_camera",
          [](const Camera& camera) { return to_numpy(camera.world_from_camera); },
          "[4,4] float64, a copy of the pose: x_in_world = world_from_camera @ x_in_camera.")
      .def("cropped", &cropped, py::arg("x0").noconvert(), py::arg("y0").noconvert(),
           py::arg("x1").noconvert(), py::arg("y1").noconvert(),
           R"(Crop the image of the camera to columns [x0, x1) and rows [y0, y1).

What it renders is that part, but for Gaussians centred far outside it: 3DGS projects those as if
they were at 1.3 times the edge of the view.

Raises:
    ValueError: The part is empty or not inside the image.)")
      .def("__eq__", &equal, py::is_operator(), py::arg("other"))
      .def("__repr__",
           [](const Camera& c) {
             return py::str(
                        "Camera(fx={}, fy={}, cx={}, cy={}, width={}, height={}, "
                        "world_from_camera={})")
                 .format(c.fx, c.fy, c.cx, c.cy, c.width, c.height,
                         to_numpy(c.world_from_camera).attr("tolist")());
           })
      .def(py::pickle(
          [](const Camera& c) {
            return py::make_tuple(c.fx, c.fy, c.cx, c.cy, c.width, c.height,
                                  to_numpy(c.world_from_camera));
          },
          [](const py::tuple& state) {
            return make_camera(state[0].cast<double>(), state[1].cast<double>(),
                               state[2].cast<double>(), state[3].cast<double>(),
                               state[4].cast<int>(), state[5].cast<int>(),
                               state[6].cast<py::array>());
          }));
}

void define_camera_functions(py::module_& m) {
  m.def(
      "camera_from_fov",
      [](int width, int height, double horizontal_fov_rad,
         const std::optional<py::array>& world_from_camera) {
        return world_from_camera
                   ? camera_from_fov(width, height, horizontal_fov_rad,
                                     to_eigen(*world_from_camera, "world_from_camera"))
                   : camera_from_fov(width, height, horizontal_fov_rad);
      },
      py::arg("width").noconvert(), py::arg("height").noconvert(), py::arg("horizontal_fov_rad"),
      py::arg("world_from_camera") = py::none(),
      R"(Make a camera with square pixels and the principal point at the image centre.

Args:
    width, height: Image size, px.
    horizontal_fov_rad: Horizontal field of view, rad, inside (0, pi).
    world_from_camera: [4,4] float64, x_in_world = world_from_camera @ x_in_camera; None means
        that the camera frame is the world frame.

Raises:
    ValueError: The field of view, the size or the pose is out of range.)");

  m.def(
      "look_at",
      [](const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up) {
        return to_numpy(look_at(eye, target, up));
      },
      py::arg("eye"), py::arg("target"), py::arg("up") = Eigen::Vector3d::UnitZ().eval(),
      R"(Compute the pose of a camera that looks at a point, its image upright.

Args:
    eye: (3,) camera centre in the world, m.
    target: (3,) point at the image centre, in the world, m.
    up: (3,) direction in the world, of any length.

Returns:
    [4,4] float64 world_from_camera.

Raises:
    ValueError: The target is the eye, or the view direction is along `up`.)");
}

template <typename T>
GaussianView<T> make_view(const py::array& means, const py::array& quats,
                          const py::array& log_scales, const py::array& logit_opacities,
                          const py::array& sh, const py::array& features, const py::array& origin,
                          const ChunkBounds* bounds) {
  GaussianView<T> view;
  view.bounds = bounds;
  view.means = require_array<T>(means, "means", {kAnyLength, 3});
  const py::ssize_t size = means.shape(0);
  view.size = static_cast<std::size_t>(size);
  view.quats = require_array<T>(quats, "quats", {size, 4});
  view.log_scales = require_array<T>(log_scales, "log_scales", {size, 3});
  view.logit_opacities = require_array<T>(logit_opacities, "logit_opacities", {size});
  view.sh = require_array<T>(sh, "sh", {size, kAnyLength, 3});
  view.sh_bases = static_cast<int>(sh.shape(1));
  view.features = require_array<T>(features, "features", {size, kAnyLength});
  view.feature_dims = static_cast<int>(features.shape(1));
  view.origin = Eigen::Map<const Eigen::Vector3d>(require_array<double>(origin, "origin", {3}));
  validate(view, "GaussianView");
  return view;
}

/// Makes the bounds of a map whose chunks are loaded when a renderer is about to read them.
ChunkBounds make_chunk_bounds(std::size_t size, const py::array& boxes, const py::array& log_scales,
                              const py::function& load) {
  const auto count = static_cast<py::ssize_t>((size + kChunkSize - 1) / kChunkSize);
  const double* corners = require_array<double>(boxes, "boxes", {count, 2, 3});
  const double* largest = require_array<double>(log_scales, "max_log_scales", {count});
  ChunkBounds bounds;
  bounds.size = size;
  for (py::ssize_t chunk = 0; chunk < count; ++chunk, corners += 6) {
    bounds.chunks.push_back({{corners[0], corners[1], corners[2]},
                             {corners[3], corners[4], corners[5]},
                             largest[chunk]});
  }
  bounds.load = [load](const std::vector<std::uint32_t>& chunks) {
    const py::gil_scoped_acquire acquire;
    load(py::array_t<std::uint32_t>(static_cast<py::ssize_t>(chunks.size()), chunks.data()));
  };
  return bounds;
}

/// Returns the largest standard deviation of each chunk as an array [C].
py::array_t<double> max_log_scales_of(const ChunkBounds& bounds) {
  Array<double> largest;
  for (const ChunkBounds::Box& box : bounds.chunks) largest.push_back(box.max_log_scale);
  return to_numpy(std::move(largest), {static_cast<py::ssize_t>(bounds.chunks.size())});
}

/// Returns the boxes of the chunks as an array [C,2,3].
py::array_t<double> boxes_of(const ChunkBounds& bounds) {
  Array<double> corners;
  for (const ChunkBounds::Box& box : bounds.chunks) {
    corners.insert(corners.end(), box.low, box.low + 3);
    corners.insert(corners.end(), box.high, box.high + 3);
  }
  return to_numpy(std::move(corners), {static_cast<py::ssize_t>(bounds.chunks.size()), 2, 3});
}

void define_chunk_bounds(py::module_& m) {
  m.attr("CHUNK_SIZE") = kChunkSize;
  py::class_<ChunkBounds>(m, "ChunkBounds",
                          "Bounds of chunks, runs of CHUNK_SIZE consecutive Gaussians: an index by "
                          "which renderers skip those out of view.")
      .def(py::init(&make_chunk_bounds), py::kw_only(), py::arg("size"), py::arg("boxes"),
           py::arg("max_log_scales"), py::arg("load"),
           R"(Bounds of a map whose chunks are loaded when they are needed.

Args:
    size: N, Gaussians of the map.
    boxes: [C,2,3] float64, as `boxes` returns them.
    max_log_scales: [C] float64, as `max_log_scales` returns them.
    load: Called with the chunks [K] uint32 that a renderer is about to read. What it raises ends
        the rendering.

Raises:
    ValueError: An array has another shape or dtype.)")
      .def("boxes", &boxes_of,
           "Return [C,2,3] lowest and highest centres of each chunk, m, relative to the origin.")
      .def("max_log_scales", &max_log_scales_of,
           "Return [C] log of the largest standard deviation of each chunk in m.");
}

template <typename T>
void define_gaussian_view(py::module_& m, const char* name) {
  using View = GaussianView<T>;
  // The view points into the arrays: it keeps each of them alive.
  py::class_<View>(m, name, "Read-only view of the arrays of N Gaussians; it copies nothing.")
      .def(py::init(&make_view<T>), py::kw_only(), py::arg("means"), py::arg("quats"),
           py::arg("log_scales"), py::arg("logit_opacities"), py::arg("sh"), py::arg("features"),
           py::arg("origin"), py::arg("bounds") = py::none(), py::keep_alive<1, 2>(),
           py::keep_alive<1, 3>(), py::keep_alive<1, 4>(), py::keep_alive<1, 5>(),
           py::keep_alive<1, 6>(), py::keep_alive<1, 7>(), py::keep_alive<1, 9>())
      .def("chunk_bounds", &chunk_bounds<T>, py::arg("function"),
           "Compute the bounds of the chunks of these Gaussians; raises as `require_finite`.")
      .def("require_finite", &require_finite<T>, py::arg("function"),
           "Raises ValueError naming `function`, the first array with a number that is not finite "
           "and its index.");
}

template <typename T>
void define_scatter_rows(py::module_& m, const char* name) {
  m.def(
      name,
      [](const py::array& rows, const py::array& values, py::ssize_t size) {
        const auto* places = require_array<std::uint32_t>(rows, "rows", {kAnyLength});
        const py::ssize_t count = rows.shape(0);
        const T* from = require_array<T>(values, "values", {count, kAnyLength});
        const py::ssize_t columns = values.shape(1);
        return to_numpy(scatter_rows(places, from, count, columns, size), {size, columns});
      },
      py::arg("rows"), py::arg("values"), py::arg("size"),
      "Scatter `values` [V,K] to `rows` [V] uint32, ascending, of an array of zeros [size,K].");
}

}  // namespace

void define_map(py::module_ m) {
  define_camera(m);
  define_camera_functions(m);
  define_chunk_bounds(m);
  define_gaussian_view<float>(m, "GaussianViewFloat");
  define_gaussian_view<double>(m, "GaussianViewDouble");
  define_scatter_rows<float>(m, "scatter_rows_float");
  define_scatter_rows<double>(m, "scatter_rows_double");
  define_scatter_rows<std::uint32_t>(m, "scatter_rows_uint32");
}

}  // namespace gslts::python
