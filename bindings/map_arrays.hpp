#pragma once

#include <pybind11/typing.h>

#include <utility>

#include "arrays.hpp"
#include "gslts/map/gaussian_map.hpp"

namespace gslts::python {

using MapArrays = py::typing::Dict<py::str, py::array>;

/// Hands the arrays of a map to numpy without copying them, by the names of `GaussianMap`.
inline MapArrays arrays_of(GaussianMap&& map) {
  const auto size = static_cast<py::ssize_t>(map.size());
  MapArrays arrays;
  arrays["means"] = to_numpy(std::move(map.means), {size, 3});
  arrays["quats"] = to_numpy(std::move(map.quats), {size, 4});
  arrays["log_scales"] = to_numpy(std::move(map.log_scales), {size, 3});
  arrays["logit_opacities"] = to_numpy(std::move(map.logit_opacities), {size});
  arrays["sh"] = to_numpy(std::move(map.sh), {size, map.sh_bases, 3});
  arrays["features"] = to_numpy(std::move(map.features), {size, map.feature_dims});
  arrays["ids"] = to_numpy(std::move(map.ids), {size});
  arrays["origin"] = py::array_t<double>(3, map.origin.data());
  return arrays;
}

}  // namespace gslts::python
