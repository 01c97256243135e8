#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>

#include "arrays.hpp"
#include "exclusive_use.hpp"
#include "gslts/raster/chunks_in_view.hpp"
#include "gslts/raster/rasterizer.hpp"

namespace gslts::python {

void define_raster_options(py::module_ m);

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

/// `Rasterizer` with numpy arrays in place of pointers. It works without the GIL, so it rejects a
/// second thread.
template <typename T>
class NumpyRasterizer {
 public:
  Arrays forward(const GaussianView<T>& gaussians, const Camera& camera,
                 const RenderOptions& options, const OptionalArray& mask) {
    const ExclusiveUse use(in_use_, "Rasterizer");
    const PixelMask pixels = pixel_mask_of(mask, camera.width, camera.height);
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
    const ExclusiveUse use(in_use_, "Rasterizer");
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
    const ExclusiveUse use(in_use_, "Rasterizer");
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

  Rasterizer<T> rasterizer_;
  std::optional<ImageSize> image_size_;  ///< Image size of the last forward.
  bool in_use_ = false;
};

constexpr const char* kForwardDoc = R"(Render one view.

Args:
    gaussians: N Gaussians.
    camera: Of the view.
    options: How to render.
    mask: [H,W] bool, True at pixels to render; None: all.

Returns:
    Arrays of `gslts.rendering.Images` by name.

Raises:
    ValueError: An option is out of range, the mask does not fit the camera, or a number of the
        Gaussians is not finite.
    RuntimeError: The Gaussians in view touch too many tiles, or another thread uses the rasterizer.)";

constexpr const char* kBackwardDoc = R"(Differentiate the last `forward`.

Args:
    gaussians: The same Gaussians, unchanged since.
    dL_drgb: [H,W,3] gradient of the loss; None: the loss ignores the image.
    dL_ddepth: [H,W], 1/m, or None.
    dL_dalpha: [H,W] or None.
    dL_dfeatures: [H,W,D] or None.
    statistics: Also return abs_dL_dmeans2d, max_weights and pixel_counts.

Returns:
    Arrays of `gslts.rendering.Gradients` by name.

Raises:
    ValueError: The sizes differ from those of the forward, or a gradient is not finite.
    RuntimeError: There was no forward, or another thread uses the rasterizer.)";

constexpr const char* kLiftDoc =
    R"(Lift a feature image of the last `forward`'s view to the Gaussians.

Args:
    gaussians: The same Gaussians, unchanged since.
    features: [H,W,D] features of the pixels; those outside the mask are ignored.

Returns:
    rows: [V] uint32, rows of the visible Gaussians, ascending.
    weighted_features: [V,D] sum over the pixels of blend weight times feature.
    weights: [V] sum over the pixels of the blend weights.

Raises:
    ValueError: The sizes differ from those of the forward, or a feature is not finite.
    RuntimeError: There was no forward, or another thread uses the rasterizer.)";

template <typename T>
void define_rasterizer(py::module_& m, const char* name) {
  using Class = NumpyRasterizer<T>;
  py::class_<Class>(m, name, "Rasterizer of one precision; see `gslts.rendering.Rasterizer`.")
      .def(py::init<>())
      .def("forward", &Class::forward, py::arg("gaussians"), py::kw_only(), py::arg("camera"),
           py::arg("options"), py::arg("mask"), kForwardDoc)
      .def("backward", &Class::backward, py::arg("gaussians"), py::kw_only(), py::arg("dL_drgb"),
           py::arg("dL_ddepth"), py::arg("dL_dalpha"), py::arg("dL_dfeatures"),
           py::arg("statistics"), kBackwardDoc)
      .def("lift", &Class::lift, py::arg("gaussians"), py::arg("features"), kLiftDoc);
}

template <typename T>
void define_chunks_in_view(py::module_& m) {
  m.def(
      "chunks_in_view",
      [](const GaussianView<T>& gaussians, const Camera& camera, const RenderOptions& options) {
        const auto chunks = raster::chunks_in_view(gaussians, camera, options);
        const auto size = static_cast<py::ssize_t>(chunks.size());
        return to_numpy(Array<std::uint32_t>(chunks.begin(), chunks.end()), {size});
      },
      py::arg("gaussians"), py::arg("camera"), py::arg("options"),
      "List the chunks [C] of a map that a rendering reads, ascending; all if it has no bounds.");
}

}  // namespace

void define_raster(py::module_ m) {
  define_raster_options(m);
  define_chunks_in_view<float>(m);
  define_chunks_in_view<double>(m);
  define_rasterizer<float>(m, "RasterizerFloat");
  define_rasterizer<double>(m, "RasterizerDouble");
}

}  // namespace gslts::python
