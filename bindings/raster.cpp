#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>

#include "arrays.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::python {
namespace {

using raster::Gradients;
using raster::ImageGradients;
using raster::Images;
using raster::LiftedFeatures;
using raster::Rasterizer;
using raster::RenderOptions;

using OptionalArray = std::optional<py::array>;
using Arrays = py::typing::Dict<py::str, py::array>;

template <typename T>
const T* optional_array(const OptionalArray& array, const char* name,
                        const std::vector<py::ssize_t>& shape) {
  return array ? require_array<T>(*array, name, shape) : nullptr;
}

/// `Rasterizer` with numpy arrays in place of pointers. While it works the GIL is free, so it turns
/// away a second thread that comes in between.
template <typename T>
class NumpyRasterizer {
 public:
  Arrays forward(const GaussianView<T>& gaussians, const Camera& camera,
                 const RenderOptions& options, const OptionalArray& mask) {
    const Use use(*this);
    PixelMask pixels;
    if (mask) {
      const bool* wanted = require_array<bool>(*mask, "mask", {camera.height, camera.width});
      pixels = {reinterpret_cast<const std::uint8_t*>(wanted), camera.width, camera.height};
    }
    image_size_.reset();
    Images<T> images = [&] {
      const py::gil_scoped_release release;
      return rasterizer_.forward(gaussians, camera, options, pixels);
    }();
    const py::ssize_t height = images.height, width = images.width, dims = images.feature_dims;
    image_size_ = {height, width, dims};

    Arrays result;
    result["rgb"] = to_numpy(std::move(images.rgb), {height, width, 3});
    result["depth"] = to_numpy(std::move(images.depth), {height, width});
    result["alpha"] = to_numpy(std::move(images.alpha), {height, width});
    result["features"] = to_numpy(std::move(images.features), {height, width, dims});
    return result;
  }

  Arrays backward(const GaussianView<T>& gaussians, const OptionalArray& dL_drgb,
                  const OptionalArray& dL_ddepth, const OptionalArray& dL_dalpha,
                  const OptionalArray& dL_dfeatures, bool statistics) {
    const Use use(*this);
    if (!image_size_) throw std::logic_error("Rasterizer.backward: there was no forward");
    const auto [height, width, dims] = *image_size_;
    ImageGradients<T> images;
    images.dL_drgb = optional_array<T>(dL_drgb, "dL_drgb", {height, width, 3});
    images.dL_ddepth = optional_array<T>(dL_ddepth, "dL_ddepth", {height, width});
    images.dL_dalpha = optional_array<T>(dL_dalpha, "dL_dalpha", {height, width});
    images.dL_dfeatures = optional_array<T>(dL_dfeatures, "dL_dfeatures", {height, width, dims});
    Gradients<T> gradients = [&] {
      const py::gil_scoped_release release;
      return rasterizer_.backward(gaussians, images, statistics);
    }();

    const auto visible = static_cast<py::ssize_t>(gradients.rows.size());
    Arrays result;
    result["rows"] = to_numpy(std::move(gradients.rows), {visible});
    result["dL_dmeans"] = to_numpy(std::move(gradients.dL_dmeans), {visible, 3});
    result["dL_dquats"] = to_numpy(std::move(gradients.dL_dquats), {visible, 4});
    result["dL_dlog_scales"] = to_numpy(std::move(gradients.dL_dlog_scales), {visible, 3});
    result["dL_dlogit_opacities"] = to_numpy(std::move(gradients.dL_dlogit_opacities), {visible});
    result["dL_dsh"] = to_numpy(std::move(gradients.dL_dsh), {visible, gaussians.sh_bases, 3});
    result["dL_dfeatures"] =
        to_numpy(std::move(gradients.dL_dfeatures), {visible, gaussians.feature_dims});
    result["dL_dtwist"] = py::array_t<double>(6, gradients.dL_dtwist.data());
    if (statistics) {
      result["abs_dL_dmeans2d"] = to_numpy(std::move(gradients.abs_dL_dmeans2d), {visible, 2});
      result["max_weights"] = to_numpy(std::move(gradients.max_weights), {visible});
      result["pixel_counts"] = to_numpy(std::move(gradients.pixel_counts), {visible});
    }
    return result;
  }

  py::typing::Tuple<py::array_t<std::uint32_t>, py::array_t<T>, py::array_t<T>> lift(
      const GaussianView<T>& gaussians, const py::array& features) {
    const Use use(*this);
    if (!image_size_) throw std::logic_error("Rasterizer.lift: there was no forward");
    const T* data = require_array<T>(features, "features",
                                     {image_size_->height, image_size_->width, kAnyLength});
    const py::ssize_t dims = features.shape(2);
    LiftedFeatures<T> lifted = [&] {
      const py::gil_scoped_release release;
      return rasterizer_.lift(gaussians, data, static_cast<int>(dims));
    }();
    const auto visible = static_cast<py::ssize_t>(lifted.rows.size());
    return py::make_tuple(to_numpy(std::move(lifted.rows), {visible}),
                          to_numpy(std::move(lifted.weighted_features), {visible, dims}),
                          to_numpy(std::move(lifted.weights), {visible}));
  }

 private:
  struct ImageSize {
    py::ssize_t height, width, feature_dims;
  };

  /// Marks the rasterizer as used for its lifetime; made and destroyed with the GIL held.
  struct Use {
    explicit Use(NumpyRasterizer& rasterizer) : in_use(rasterizer.in_use_) {
      if (in_use) {
        throw std::runtime_error("Rasterizer: in use by another thread; each thread needs its own");
      }
      in_use = true;
    }
    ~Use() { in_use = false; }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    bool& in_use;
  };

  Rasterizer<T> rasterizer_;
  std::optional<ImageSize> image_size_;  ///< Of the last forward.
  bool in_use_ = false;
};

RenderOptions make_options(std::array<double, 3> background, double near_m, double near_sigmas,
                           int sh_degree, bool clamp_colors, double eps2d_px2, bool antialias,
                           bool surface_depth, double alpha_min, double transmittance_min,
                           int exp_degree, int threads) {
  return {background, near_m,        near_sigmas, sh_degree,         clamp_colors, eps2d_px2,
          antialias,  surface_depth, alpha_min,   transmittance_min, exp_degree,   threads};
}

/// The arguments of make_options.
py::tuple fields(const RenderOptions& o) {
  return py::make_tuple(py::make_tuple(o.background[0], o.background[1], o.background[2]), o.near_m,
                        o.near_sigmas, o.sh_degree, o.clamp_colors, o.eps2d_px2, o.antialias,
                        o.surface_depth, o.alpha_min, o.transmittance_min, o.exp_degree, o.threads);
}

void define_options(py::module_& m) {
  const RenderOptions defaults;
  py::class_<RenderOptions>(m, "RenderOptions", R"(How to render; immutable.

The defaults are those of 3DGS (Kerbl et al. 2023) but for the near plane and alpha_min, which is
1/255 there: half of it brings the image 5 dB nearer to the exact one for 4 % of the time.

Args:
    background: RGB behind the Gaussians.
    near_m: Gaussians with centre depth z <= near_m are not seen, m. > 0
    near_sigmas: Gaussians whose depth is at most so many of its standard deviations are not seen:
        projection linearises them at their centre, which fails where they reach the camera's plane,
        and makes fog of a wall beside the camera (the guard band of Kerbl et al. 2023, sec. 6).
        >= 0
    sh_degree: Highest SH degree used, 0 to 3; the map's own degree caps it.
    clamp_colors: Colours below 0 count as 0, as in 3DGS; if false they are kept, and `rgb` is
        linear in `sh`.
    eps2d_px2: Variance added to each projected covariance, px^2. >= 0
    antialias: Scale opacity by sqrt(det(cov2d) / det(cov2d + eps2d I)), so that small or distant
        Gaussians keep their energy (Mip-Splatting, Yu et al. 2024, eq. 9).
    surface_depth: A Gaussian's depth at a pixel is the mean of those of its points that are seen
        there (RaDe-GS, Zhang et al. 2024), so that slanted surfaces are true; if false it is that
        of its centre, as in 3DGS. Where it would change by half within the footprint, that of the
        centre is taken, too.
    alpha_min: A Gaussian is skipped at a pixel where its alpha is below this. In [1e-30, 0.99)
    transmittance_min: A pixel ends before the Gaussian that would take its transmittance below
        this. In [0, 1)
    exp_degree: Degree of the polynomial in the place of exp: 3, with an error of alpha of up to
        8e-5 of it, far below that of the cut-off, or 5, to the precision of float32. float64 always
        takes the exact exp.
    threads: 0 means one a hardware thread. Results do not depend on it.

The values are checked by each rendering.)")
      .def(py::init(&make_options), py::kw_only(), py::arg("background") = defaults.background,
           py::arg("near_m") = defaults.near_m, py::arg("near_sigmas") = defaults.near_sigmas,
           py::arg("sh_degree").noconvert() = defaults.sh_degree,
           py::arg("clamp_colors") = defaults.clamp_colors,
           py::arg("eps2d_px2") = defaults.eps2d_px2, py::arg("antialias") = defaults.antialias,
           py::arg("surface_depth") = defaults.surface_depth,
           py::arg("alpha_min") = defaults.alpha_min,
           py::arg("transmittance_min") = defaults.transmittance_min,
           py::arg("exp_degree").noconvert() = defaults.exp_degree,
           py::arg("threads").noconvert() = defaults.threads)
      .def_property_readonly(
          "background", [](const RenderOptions& o) { return fields(o)[0].cast<py::tuple>(); },
          "RGB behind the Gaussians.")
      .def_readonly("near_m", &RenderOptions::near_m, "Near plane, m.")
      .def_readonly("near_sigmas", &RenderOptions::near_sigmas,
                    "Least depth, in standard deviations of a Gaussian's own.")
      .def_readonly("sh_degree", &RenderOptions::sh_degree, "Highest SH degree used.")
      .def_readonly("clamp_colors", &RenderOptions::clamp_colors, "Colours below 0 count as 0.")
      .def_readonly("eps2d_px2", &RenderOptions::eps2d_px2,
                    "Variance added to each projected covariance, px^2.")
      .def_readonly("antialias", &RenderOptions::antialias, "Keep the energy of small Gaussians.")
      .def_readonly("surface_depth", &RenderOptions::surface_depth,
                    "Depth of what is seen at a pixel and not of the centre.")
      .def_readonly("alpha_min", &RenderOptions::alpha_min, "Least alpha that is blended.")
      .def_readonly("transmittance_min", &RenderOptions::transmittance_min,
                    "Least transmittance left at a pixel.")
      .def_readonly("exp_degree", &RenderOptions::exp_degree, "Degree of the polynomial for exp.")
      .def_readonly("threads", &RenderOptions::threads, "Threads; 0 means one a hardware thread.")
      .def(
          "__eq__",
          [](const RenderOptions& a, const RenderOptions& b) { return fields(a).equal(fields(b)); },
          py::is_operator(), py::arg("other"))
      .def("__repr__",
           [](const RenderOptions& o) {
             return py::
                 str("RenderOptions(background={}, near_m={}, near_sigmas={}, sh_degree={}, "
                     "clamp_colors={}, eps2d_px2={}, antialias={}, surface_depth={}, alpha_min={}, "
                     "transmittance_min={}, exp_degree={}, threads={})")
                     .format(*fields(o));
           })
      .def(py::pickle(&fields, [](const py::tuple& state) {
        return make_options(state[0].cast<std::array<double, 3>>(), state[1].cast<double>(),
                            state[2].cast<double>(), state[3].cast<int>(), state[4].cast<bool>(),
                            state[5].cast<double>(), state[6].cast<bool>(), state[7].cast<bool>(),
                            state[8].cast<double>(), state[9].cast<double>(), state[10].cast<int>(),
                            state[11].cast<int>());
      }));
}

template <typename T>
void define_rasterizer(py::module_& m, const char* name) {
  using Class = NumpyRasterizer<T>;
  py::class_<Class>(m, name, "Rasterizer of one precision; see gslts.Rasterizer.")
      .def(py::init<>())
      .def("forward", &Class::forward, py::arg("gaussians"), py::kw_only(), py::arg("camera"),
           py::arg("options"), py::arg("mask"),
           "Renders one view; returns the arrays of `gslts.Images` by name.")
      .def("backward", &Class::backward, py::arg("gaussians"), py::kw_only(), py::arg("dL_drgb"),
           py::arg("dL_ddepth"), py::arg("dL_dalpha"), py::arg("dL_dfeatures"),
           py::arg("statistics"),
           "Differentiates the last forward; returns the arrays of `gslts.Gradients` by name.")
      .def("lift", &Class::lift, py::arg("gaussians"), py::arg("features"),
           "Lifts onto what the last forward saw; returns the arrays of `gslts.LiftedFeatures`.");
}

}  // namespace

void define_raster(py::module_ m) {
  define_options(m);
  define_rasterizer<float>(m, "RasterizerFloat");
  define_rasterizer<double>(m, "RasterizerDouble");
}

}  // namespace gslts::python
