#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <pybind11/typing.h>

#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "gslts/io/ply.hpp"
#include "map_arrays.hpp"

namespace gslts::python {
namespace {

py::object to_python(const std::filesystem::path& path) {
  return py::reinterpret_steal<py::object>(PyUnicode_DecodeFSDefault(path.c_str()));
}

/// Runs the function without the GIL. An error of the system arrives in Python as the OSError of
/// its errno, and bad contents as ValueError.
template <typename Function>
auto with_python_errors(const std::filesystem::path& path, Function function) {
  try {
    const py::gil_scoped_release release;
    return function(path.string());
  } catch (const std::system_error& error) {
    const int code = error.code().value();
    const py::object exception = py::reinterpret_borrow<py::object>(PyExc_OSError)(
        code, error.code().message(), to_python(path));
    PyErr_SetObject(py::type::handle_of(exception).ptr(), exception.ptr());
  } catch (const std::runtime_error& error) {
    // The path in it need not be UTF-8.
    PyErr_SetObject(PyExc_ValueError, to_python(error.what()).ptr());
  }
  throw py::error_already_set();
}

py::typing::Tuple<MapArrays, std::vector<std::string>> read_ply(const std::filesystem::path& path) {
  io::PlyContents contents = with_python_errors(path, io::read_ply);
  return py::make_tuple(arrays_of(std::move(contents.map)), contents.ignored_properties);
}

void write_ply(const GaussianView<float>& gaussians, const py::array& ids,
               const std::filesystem::path& path) {
  const py::ssize_t size = static_cast<py::ssize_t>(gaussians.size);
  const std::uint64_t* const first = require_array<std::uint64_t>(ids, "ids", {size});
  with_python_errors(path, [&](const std::string& text) { io::write_ply(gaussians, first, text); });
}

}  // namespace

void define_io(py::module_ m) {
  m.def("read_ply", &read_ply, py::arg("path"),
        "See gslts.io.ply.read_ply; returns the arrays of the map by name, and the names of the "
        "properties that it ignored.");
  m.def("write_ply", &write_ply, py::arg("gaussians"), py::arg("ids"), py::arg("path"),
        "See gslts.io.ply.write_ply.");
}

}  // namespace gslts::python
