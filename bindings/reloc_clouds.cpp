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
  py::class_<CloudRule>(m, "CloudRule", R"(How clouds are brought together.

Args:
    voxel_m: Both clouds are thinned to one point in each, m, 1e-4 to 10.
    most_distant_m: Points that are farther apart are not paired, m, above 0 and up to 100.
    neighbours: Of a point, that tell its plane, at least 4.
    iterations: At most, at least 1.)")
      .def(py::init([](double voxel_m, double most_distant_m, int neighbours, int iterations) {
             return CloudRule{voxel_m, most_distant_m, neighbours, iterations};
           }),
           py::kw_only(), py::arg("voxel_m") = rule.voxel_m,
           py::arg("most_distant_m") = rule.most_distant_m,
           py::arg("neighbours").noconvert() = rule.neighbours,
           py::arg("iterations").noconvert() = rule.iterations)
      .def_readonly("voxel_m", &CloudRule::voxel_m)
      .def_readonly("most_distant_m", &CloudRule::most_distant_m)
      .def_readonly("neighbours", &CloudRule::neighbours)
      .def_readonly("iterations", &CloudRule::iterations);

  py::class_<Registration>(m, "Registration", "A motion that brings one cloud onto another.")
      .def_property_readonly(
          "target_from_source",
          [](const Registration& found) { return to_numpy(found.target_from_source); },
          "[4,4] float64, a copy: x_in_target = target_from_source @ x_in_source.")
      .def_readonly("overlap", &Registration::overlap,
                    "Share of the thinned source points that have a partner, 0 to 1.")
      .def_readonly("rms_m", &Registration::rms_m,
                    "Of their distances from the planes of their partners, m; 0 if there are none.")
      .def_readonly("converged", &Registration::converged,
                    "Whether it came to rest before the iterations ran out. False also where a "
                    "thinned cloud has fewer points than `neighbours`: then the guess comes back, "
                    "with no overlap.");

  m.def("register_clouds", &register_clouds, py::arg("source"), py::arg("target"), py::arg("guess"),
        py::kw_only(), py::arg("rule"),
        R"(Brings the surfaces of one cloud onto those of another: generalised ICP.

Along a single plane or a corridor nothing holds the clouds; there the motion stays near the guess.

Args:
    source: [N,3] float32, m.
    target: [M,3] float32, m; only what is around the source counts.
    guess: [4,4] float64 target_from_source, some `most_distant_m` off at most.
    rule: How it is done.

Raises:
    ValueError: A point is not finite, the guess is not a rigid motion, the rule is out of range, or
        a cloud spans more than 2^31 voxels.

Source: Segal et al., Generalized-ICP, 2009; PCL.)");
}

}  // namespace gslts::python
