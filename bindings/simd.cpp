#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "gslts/simd/target.hpp"

namespace gslts::python {

namespace py = pybind11;

void define_simd(py::module_ m) {
  m.def("target", &simd::target,
        "Return the name of the instruction set that the kernels use: sse4, avx2, avx512 or neon.");
  m.def("targets", &simd::targets,
        "Return the names of the instruction sets that this machine can use, the best first.");
  m.def("use_target", &simd::use_target, py::arg("name"),
        R"(Make the kernels use an instruction set from now on. Call it while no kernel runs.

Args:
    name: One of `targets`.

Raises:
    ValueError: This machine cannot use it.)");
}

}  // namespace gslts::python
