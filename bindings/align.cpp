#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <optional>
#include <string>

#include "arrays.hpp"
#include "gslts/align/normal_equations.hpp"

namespace gslts::python {
namespace {

using align::Alignment;
using optim::Exposure;
using Matrix10 = Eigen::Matrix<double, 10, 10>;
using Vector10 = Eigen::Matrix<double, 10, 1>;

template <typename T>
py::typing::Tuple<Matrix10, Vector10, Matrix10, Vector10> alignment_of(
    const Camera& camera, const py::array& rgb, const py::array& depth, const py::array& photo,
    const py::array& measured, const std::optional<py::array>& mask, const Exposure& exposure,
    int threads) {
  const py::ssize_t height = camera.height, width = camera.width;
  const T* colors = require_array<T>(rgb, "rgb", {height, width, 3});
  const T* depths = require_array<T>(depth, "depth", {height, width});
  const T* seen = require_array<T>(photo, "photo", {height, width, 3});
  const T* distances = require_array<T>(measured, "measured", {height, width});
  const PixelMask pixels = pixel_mask_of(mask, camera.width, camera.height);
  const Alignment alignment = [&] {
    const py::gil_scoped_release release;
    return align::align(camera, colors, depths, seen, distances, pixels, exposure, threads);
  }();
  return py::make_tuple(alignment.color.hessian, alignment.color.right, alignment.depth.hessian,
                        alignment.depth.right);
}

template <typename T>
void define_precision(py::module_& m, const std::string& suffix) {
  m.def(("align" + suffix).c_str(), &alignment_of<T>, py::arg("camera"), py::arg("rgb"),
        py::arg("depth"), py::arg("photo"), py::arg("measured"), py::kw_only(), py::arg("mask"),
        py::arg("exposure"), py::arg("threads").noconvert(),
        "See gslts.localization.alignment.align; returns hessian and right side of colour, and of "
        "depth.");
}

}  // namespace

void define_align(py::module_ m) {
  define_precision<float>(m, "_float");
  define_precision<double>(m, "_double");
}

}  // namespace gslts::python
