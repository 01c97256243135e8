#include <cstddef>

#include "gslts/reloc/register_clouds.hpp"
#include "poses.hpp"

namespace gslts::python {
namespace {

using reloc::CloudRule;
using reloc::Registration;

Registration register_clouds(const py::array& source, const py::array& target,
                             const py::array& guess, const CloudRule& rule) {
  const float* from = require_array<float>(source, "source", {kAnyLength, 3});
  const float* onto = require_array<float>(target, "target", {kAnyLength, 3});
  const auto sources = static_cast<std::size_t>(source.shape(0));
  const auto targets = static_cast<std::size_t>(target.shape(0));
  const Eigen::Isometry3d target_from_source = to_eigen(guess, "guess");
  const py::gil_scoped_release release;
  return reloc::register_clouds(from, sources, onto, targets, target_from_source, rule);
}

}  // namespace

void define_reloc_clouds(py::module_ m) {
  const CloudRule rule;
  py::class_<CloudRule>(m, "CloudRule", R"(Settings of the registration of two clouds.

Args:
    voxel_m: Edge of the voxels that both are downsampled to, m, 1e-4 to 10.
    max_distance_m: Maximum distance of corresponding points, m, above 0 and up to 100.
    neighbours: Number of points that determine the plane at a point, at least 4.
    iterations: Maximum number, at least 1.)")
      .def(py::init([](double voxel_m, double max_distance_m, int neighbours, int iterations) {
             return CloudRule{voxel_m, max_distance_m, neighbours, iterations};
           }),
           py::kw_only(), py::arg("voxel_m") = rule.voxel_m,
           py::arg("max_distance_m") = rule.max_distance_m,
           py::arg("neighbours").noconvert() = rule.neighbours,
           py::arg("iterations").noconvert() = rule.iterations)
      .def_readonly("voxel_m", &CloudRule::voxel_m)
      .def_readonly("max_distance_m", &CloudRule::max_distance_m)
      .def_readonly("neighbours", &CloudRule::neighbours)
      .def_readonly("iterations", &CloudRule::iterations);

  py::class_<Registration>(m, "Registration",
                           "A rigid motion that registers one cloud with another.")
      .def_property_readonly(
          "target_from_source",
          [](const Registration& found) { return to_numpy(found.target_from_source); },
          "[4,4] float64, a copy: x_in_target = target_from_source @ x_in_source.")
      .def_readonly("overlap", &Registration::overlap,
                    "Share of the downsampled source points with a correspondence, 0 to 1.")
      .def_readonly("rms_m", &Registration::rms_m,
                    "RMS distance of these from the planes of the target, m; 0 if there are none.")
      .def_readonly("converged", &Registration::converged,
                    "Whether the motion converged within the iterations. False also where a "
                    "downsampled cloud has fewer points than `neighbours`: then the guess is "
                    "returned, with no overlap.");

  m.def("register_clouds", &register_clouds, py::arg("source"), py::arg("target"), py::arg("guess"),
        py::kw_only(), py::arg("rule"),
        R"(Register two clouds by generalised ICP, plane to plane.

Where the clouds do not constrain the motion, such as along a wall, it stays near the guess.

Args:
    source: [N,3] float32, m.
    target: [M,3] float32, m; only points near the source are used.
    guess: [4,4] float64 target_from_source, up to about `max_distance_m` off.
    rule: Settings.

Raises:
    ValueError: A point is not finite, the guess is not a rigid motion, the rule is out of range, or
        a cloud spans more than 2^31 voxels.

Source: Segal et al., Generalized-ICP, 2009; PCL.)");
}

}  // namespace gslts::python
