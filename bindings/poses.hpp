#pragma once

#include <Eigen/Geometry>
#include <string>

#include "arrays.hpp"

namespace gslts::python {

using RowMajorMatrix4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// A rigid motion from [4,4] float64; its rotation is checked by what takes it.
/// @throws py::value_error  naming the array, what was expected and what came.
inline Eigen::Isometry3d to_eigen(const py::array& transform, const char* name) {
  const py::array contiguous = py::array::ensure(transform, py::array::c_style);
  const Eigen::Map<const RowMajorMatrix4d> matrix(require_array<double>(contiguous, name, {4, 4}));
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw py::value_error(std::string(name) + ": the last row must be (0, 0, 0, 1), got " +
                          std::string(py::repr(transform.attr("tolist")().attr("pop")())));
  }
  Eigen::Isometry3d result;
  result.matrix() = matrix;
  return result;
}

/// [4,4] float64
inline py::array_t<double> to_numpy(const Eigen::Isometry3d& transform) {
  py::array_t<double> result({4, 4});
  Eigen::Map<RowMajorMatrix4d>(result.mutable_data()) = transform.matrix();
  return result;
}

}  // namespace gslts::python
