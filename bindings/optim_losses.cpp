#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <array>
#include <optional>
#include <string>

#include "arrays.hpp"
#include "gslts/optim/losses.hpp"

namespace gslts::python {
namespace {

using optim::DepthLoss;
using optim::Exposure;
using optim::PhotometricLoss;

using OptionalArray = std::optional<py::array>;

struct ImageSize {
  int height, width;
};

/// Size of an array that is checked later.
ImageSize size_of(const py::array& image) {
  if (image.ndim() < 2) return {0, 0};
  return {static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1))};
}

template <typename T>
Exposure fit_exposure(const py::array& rgb, const py::array& target, const OptionalArray& mask,
                      int threads) {
  const ImageSize size = size_of(rgb);
  const T* rendered = require_array<T>(rgb, "rgb", {size.height, size.width, 3});
  const T* measured = require_array<T>(target, "target", {size.height, size.width, 3});
  const PixelMask pixels = pixel_mask_of(mask, size.width, size.height);
  const py::gil_scoped_release release;
  return optim::fit_exposure(rendered, measured, size.width, size.height, pixels, threads);
}

template <typename T>
py::typing::Tuple<double, double, double, py::array_t<T>> photometric_loss(
    const py::array& rgb, const py::array& target, const OptionalArray& mask, double dssim_weight,
    const Exposure& exposure, int threads) {
  const ImageSize size = size_of(rgb);
  const T* rendered = require_array<T>(rgb, "rgb", {size.height, size.width, 3});
  const T* measured = require_array<T>(target, "target", {size.height, size.width, 3});
  const PixelMask pixels = pixel_mask_of(mask, size.width, size.height);
  PhotometricLoss<T> loss = [&] {
    const py::gil_scoped_release release;
    return optim::photometric_loss(rendered, measured, size.width, size.height, pixels,
                                   dssim_weight, exposure, threads);
  }();
  return py::make_tuple(loss.value, loss.l1, loss.ssim,
                        to_numpy(std::move(loss.dL_drgb), {size.height, size.width, 3}));
}

template <typename T>
py::typing::Tuple<double, std::size_t, py::array_t<T>> depth_loss(const py::array& depth,
                                                                  const py::array& target,
                                                                  const OptionalArray& mask,
                                                                  bool relative, int threads) {
  const ImageSize size = size_of(depth);
  const T* rendered = require_array<T>(depth, "depth", {size.height, size.width});
  const T* measured = require_array<T>(target, "target", {size.height, size.width});
  const PixelMask pixels = pixel_mask_of(mask, size.width, size.height);
  DepthLoss<T> loss = [&] {
    const py::gil_scoped_release release;
    return optim::depth_loss(rendered, measured, size.width, size.height, pixels, relative,
                             threads);
  }();
  return py::make_tuple(loss.value, loss.count,
                        to_numpy(std::move(loss.dL_ddepth), {size.height, size.width}));
}

template <typename T>
void define_precision(py::module_& m, const std::string& suffix) {
  m.def(("fit_exposure" + suffix).c_str(), &fit_exposure<T>, py::arg("rgb"), py::arg("target"),
        py::kw_only(), py::arg("mask"), py::arg("threads").noconvert(),
        "See gslts.rendering.losses.fit_exposure.");
  m.def(("photometric_loss" + suffix).c_str(), &photometric_loss<T>, py::arg("rgb"),
        py::arg("target"), py::kw_only(), py::arg("mask"), py::arg("dssim_weight"),
        py::arg("exposure"), py::arg("threads").noconvert(),
        "See gslts.rendering.losses.photometric_loss; returns value, l1, ssim and gradient.");
  m.def(("depth_loss" + suffix).c_str(), &depth_loss<T>, py::arg("depth"), py::arg("target"),
        py::kw_only(), py::arg("mask"), py::arg("relative").noconvert(),
        py::arg("threads").noconvert(),
        "See gslts.rendering.losses.depth_loss; returns value, count and gradient.");
}

py::tuple fields(const Exposure& exposure) {
  return py::make_tuple(py::tuple(py::cast(exposure.gain)), py::tuple(py::cast(exposure.offset)));
}

}  // namespace

void define_optim_losses(py::module_ m) {
  py::class_<Exposure>(m, "Exposure", R"(Colour correction of one image; immutable.

observed = gain * rendered + offset, for each channel.

Args:
    gain: Factors of red, green and blue.
    offset: Offsets of red, green and blue.)")
      .def(py::init([](const std::array<double, 3>& gain, const std::array<double, 3>& offset) {
             return Exposure{gain, offset};
           }),
           py::kw_only(), py::arg("gain") = Exposure().gain, py::arg("offset") = Exposure().offset)
      .def_property_readonly(
          "gain", [](const Exposure& e) { return fields(e)[0].cast<py::tuple>(); },
          "Factors of red, green and blue.")
      .def_property_readonly(
          "offset", [](const Exposure& e) { return fields(e)[1].cast<py::tuple>(); },
          "Offsets of red, green and blue.")
      .def(
          "__eq__", [](const Exposure& a, const Exposure& b) { return fields(a).equal(fields(b)); },
          py::is_operator(), py::arg("other"))
      .def("__repr__",
           [](const Exposure& e) {
             return py::str("Exposure(gain={}, offset={})").format(*fields(e));
           })
      .def(py::pickle(&fields, [](const py::tuple& state) {
        using Channels = std::array<double, 3>;
        return Exposure{state[0].cast<Channels>(), state[1].cast<Channels>()};
      }));
  define_precision<float>(m, "_float");
  define_precision<double>(m, "_double");
}

}  // namespace gslts::python
