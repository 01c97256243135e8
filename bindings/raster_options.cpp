#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>

#include "gslts/raster/rasterizer.hpp"

namespace gslts::python {
namespace {

namespace py = pybind11;
using raster::RenderOptions;

RenderOptions make_options(std::array<double, 3> background, double near_m, double far_m,
                           double near_sigmas, int sh_degree, bool clamp_colors, double eps2d_px2,
                           bool antialias, bool surface_depth, double alpha_min,
                           double transmittance_min, int exp_degree, int threads) {
  return {background,        near_m,     far_m,     near_sigmas,   sh_degree,
          clamp_colors,      eps2d_px2,  antialias, surface_depth, alpha_min,
          transmittance_min, exp_degree, threads};
}

/// Lists the arguments of `make_options`.
py::tuple fields(const RenderOptions& o) {
  return py::make_tuple(py::make_tuple(o.background[0], o.background[1], o.background[2]), o.near_m,
                        o.far_m, o.near_sigmas, o.sh_degree, o.clamp_colors, o.eps2d_px2,
                        o.antialias, o.surface_depth, o.alpha_min, o.transmittance_min,
                        o.exp_degree, o.threads);
}

constexpr const char* kOptionsDoc =
    R"(Options of rendering; immutable. Each rendering checks the values.

The defaults are those of 3DGS (Kerbl et al. 2023) but for the near plane and alpha_min, which is
1/255 there: half of it brings the image 5 dB nearer to the exact one for 4 % of the time.

Args:
    background: RGB behind the Gaussians.
    near_m: Near plane: Gaussians with centre depth z <= near_m are culled, m. > 0
    far_m: Far plane: Gaussians with centre depth z > far_m are culled, m. > near_m
    near_sigmas: Gaussians within so many standard deviations of depth of the camera are culled: the
        affine projection is invalid there, and turns a wall beside the camera into fog (the guard
        band of Kerbl et al. 2023, sec. 6). >= 0
    sh_degree: Maximum SH degree used, 0 to 3; the map's own degree caps it.
    clamp_colors: Colours below 0 count as 0, as in 3DGS; if false they are kept, and `rgb` is
        linear in `sh`.
    eps2d_px2: Variance added to each projected covariance, px^2. >= 0
    antialias: Scale opacity by sqrt(det(cov2d) / det(cov2d + eps2d I)), so that small or distant
        Gaussians keep their energy (Mip-Splatting, Yu et al. 2024, eq. 9).
    surface_depth: A Gaussian's depth changes across its footprint as that of its visible points
        (RaDe-GS, Zhang et al. 2024), so that slanted surfaces are exact; if false it is that of its
        centre, as in 3DGS. Where it would change by half within the footprint, it is that of the
        centre, too.
    alpha_min: Minimum alpha of a Gaussian that is blended at a pixel. In [1e-30, 0.99)
    transmittance_min: Minimum transmittance of a pixel; it ends before the Gaussian that would
        leave less. In [0, 1)
    exp_degree: Degree of the polynomial that replaces exp: 3, with a relative error of alpha of up
        to 8e-5, far below that of alpha_min, or 5, to the precision of float32. float64 always
        takes the exact exp.
    threads: Number of threads; 0: one a hardware thread. Results do not depend on it.)";

}  // namespace

void define_raster_options(py::module_ m) {
  const RenderOptions defaults;
  py::class_<RenderOptions>(m, "RenderOptions", kOptionsDoc)
      .def(py::init(&make_options), py::kw_only(), py::arg("background") = defaults.background,
           py::arg("near_m") = defaults.near_m, py::arg("far_m") = defaults.far_m,
           py::arg("near_sigmas") = defaults.near_sigmas,
           py::arg("sh_degree").noconvert() = defaults.sh_degree,
           py::arg("clamp_colors") = defaults.clamp_colors,
           py::arg("eps2d_px2") = defaults.eps2d_px2, py::arg("antialias") = defaults.antialias,
           py::arg("surface_depth") = defaults.surface_depth,
           py::arg("alpha_min") = defaults.alpha_min,
           py::arg("transmittance_min") = defaults.transmittance_min,
           py::arg("exp_degree").noconvert() = defaults.exp_degree,
           py::arg("threads").noconvert() = defaults.threads)
      .def_property_readonly("background",
                             [](const RenderOptions& o) { return fields(o)[0].cast<py::tuple>(); })
      .def_readonly("near_m", &RenderOptions::near_m)
      .def_readonly("far_m", &RenderOptions::far_m)
      .def_readonly("near_sigmas", &RenderOptions::near_sigmas)
      .def_readonly("sh_degree", &RenderOptions::sh_degree)
      .def_readonly("clamp_colors", &RenderOptions::clamp_colors)
      .def_readonly("eps2d_px2", &RenderOptions::eps2d_px2)
      .def_readonly("antialias", &RenderOptions::antialias)
      .def_readonly("surface_depth", &RenderOptions::surface_depth)
      .def_readonly("alpha_min", &RenderOptions::alpha_min)
      .def_readonly("transmittance_min", &RenderOptions::transmittance_min)
      .def_readonly("exp_degree", &RenderOptions::exp_degree)
      .def_readonly("threads", &RenderOptions::threads)
      .def(
          "__eq__",
          [](const RenderOptions& a, const RenderOptions& b) { return fields(a).equal(fields(b)); },
          py::is_operator(), py::arg("other"))
      .def("__repr__",
           [](const RenderOptions& o) {
             return py::
                 str("RenderOptions(background={}, near_m={}, far_m={}, near_sigmas={}, "
                     "sh_degree={}, "
                     "clamp_colors={}, eps2d_px2={}, antialias={}, surface_depth={}, alpha_min={}, "
                     "transmittance_min={}, exp_degree={}, threads={})")
                     .format(*fields(o));
           })
      .def(py::pickle(&fields, [](const py::tuple& state) {
        return make_options(state[0].cast<std::array<double, 3>>(), state[1].cast<double>(),
                            state[2].cast<double>(), state[3].cast<double>(), state[4].cast<int>(),
                            state[5].cast<bool>(), state[6].cast<double>(), state[7].cast<bool>(),
                            state[8].cast<bool>(), state[9].cast<double>(),
                            state[10].cast<double>(), state[11].cast<int>(), state[12].cast<int>());
      }));
}

}  // namespace gslts::python
