#include <cstdint>
#include <utility>

#include "arrays.hpp"
#include "gslts/plan/distance_field.hpp"

namespace gslts::python {
namespace {

py::array_t<double> distance_field(const py::array& free, const py::array& goals, double cell_m) {
  const bool* passable = require_array<bool>(free, "free", {kAnyLength, kAnyLength});
  const py::ssize_t rows = free.shape(0), columns = free.shape(1);
  const bool* ends = require_array<bool>(goals, "goals", {rows, columns});
  Array<double> distances = [&] {
    const py::gil_scoped_release release;
    return plan::distance_field(reinterpret_cast<const std::uint8_t*>(passable),
                                reinterpret_cast<const std::uint8_t*>(ends), int(rows),
                                int(columns), cell_m);
  }();
  return to_numpy(std::move(distances), {rows, columns});
}

}  // namespace

void define_plan(py::module_ m) {
  m.def("distance_field", &distance_field, py::arg("free"), py::arg("goals"), py::kw_only(),
        py::arg("cell_m"), "See gslts.navigation.planner.distance_field_m.");
}

}  // namespace gslts::python
