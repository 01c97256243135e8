#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/map/pixel_mask.hpp"

namespace gslts::python {

namespace py = pybind11;

/// Length in an expected shape that every length satisfies.
inline constexpr py::ssize_t kAnyLength = -1;

/// "(5, 3)"; an unspecified length prints as "*".
inline std::string shape_text(const std::vector<py::ssize_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (i > 0) text += ", ";
    text += shape[i] == kAnyLength ? "*" : std::to_string(shape[i]);
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

/// The elements of an array argument, which must have exactly this type and shape and lie
/// contiguously in C order: pybind11 alone would convert, copy or broadcast it in silence.
/// @throws py::value_error  naming the array, what was expected and what came.
template <typename T>
const T* require_array(const py::array& array, const char* name,
                       const std::vector<py::ssize_t>& expected) {
  const std::vector<py::ssize_t> shape(array.shape(), array.shape() + array.ndim());
  const auto length_fits = [](py::ssize_t actual, py::ssize_t wanted) {
    return wanted == kAnyLength || wanted == actual;
  };
  const bool shape_fits =
      std::equal(shape.begin(), shape.end(), expected.begin(), expected.end(), length_fits);
  const bool contiguous = (array.flags() & py::array::c_style) != 0;
  const bool aligned = (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0;
  if (!py::isinstance<py::array_t<T, 0>>(array) || !shape_fits || !contiguous || !aligned) {
    throw py::value_error(std::string(name) + ": expected a C-contiguous " +
                          std::string(py::str(py::dtype::of<T>())) + " array of shape " +
                          shape_text(expected) + ", got " + std::string(py::str(array.dtype())) +
                          " " + shape_text(shape) + (contiguous ? "" : ", not C-contiguous") +
                          (aligned ? "" : ", not aligned"));
  }
  return static_cast<const T*>(array.data());
}

/// Checks that there is one image per camera.
/// @throws std::invalid_argument  naming the images.
inline void require_one_each(const char* name, const std::vector<py::array>& images,
                             std::size_t cameras) {
  if (images.size() == cameras) return;
  throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(cameras) +
                              ", one per camera, got " + std::to_string(images.size()));
}

/// Returns the wanted pixels [height,width] of an image; all without a mask.
/// @throws py::value_error  as `require_array`.
inline PixelMask pixel_mask_of(const std::optional<py::array>& mask, int width, int height) {
  if (!mask) return {};
  const bool* wanted = require_array<bool>(*mask, "mask", {height, width});
  return {reinterpret_cast<const std::uint8_t*>(wanted), width, height};
}

/// Hands the elements to numpy without copying them.
template <typename T>
py::array_t<T> to_numpy(Array<T>&& elements, const std::vector<py::ssize_t>& shape) {
  auto owner = std::make_unique<Array<T>>(std::move(elements));
  const T* data = owner->data();
  const py::capsule free_owner(owner.get(), [](void* p) { delete static_cast<Array<T>*>(p); });
  owner.release();
  return py::array_t<T>(shape, data, free_owner);
}

}  // namespace gslts::python
