#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "exclusive_use.hpp"
#include "gslts/optim/adam.hpp"

namespace gslts::python {
namespace {

using optim::Adam;
using optim::AdamOptions;
using optim::AdamRates;
using optim::AdamState;
using optim::kAdamGroups;
using raster::GradientsView;

template <typename T>
BasicGaussianMap<T> copy_of(const GaussianView<T>& view) {
  auto map = make_gaussian_map<T>(view.size, view.sh_bases, view.feature_dims);
  map.origin = view.origin;
  const auto copy = [](const T* from, Array<T>& to) { std::copy_n(from, to.size(), to.data()); };
  copy(view.means, map.means);
  copy(view.quats, map.quats);
  copy(view.log_scales, map.log_scales);
  copy(view.logit_opacities, map.logit_opacities);
  copy(view.sh, map.sh);
  copy(view.features, map.features);
  return map;
}

template <typename T>
Array<T> copy_of(const py::array& array, const char* name, const std::vector<py::ssize_t>& shape) {
  const T* data = require_array<T>(array, name, shape);
  return Array<T>(data, data + array.size());
}

/// `Adam` with the map that it moves, whose numbers numpy sees without a copy. It works without the
/// GIL, so it rejects a second thread.
template <typename T>
class NumpyAdam {
 public:
  NumpyAdam(const GaussianView<T>& gaussians, const AdamOptions& options)
      : map_(copy_of(gaussians)), adam_(map_.size(), map_.sh_bases, map_.feature_dims, options) {}

  NumpyAdam(const GaussianView<T>& gaussians, const py::array& first, const py::array& second,
            const py::array& steps, const AdamOptions& options)
      : map_(copy_of(gaussians)),
        adam_(AdamState<T>{map_.sh_bases, map_.feature_dims,
                           copy_of<T>(first, "first", {rows(), kAnyLength}),
                           copy_of<T>(second, "second", {rows(), kAnyLength}),
                           copy_of<std::uint32_t>(steps, "steps", {rows(), kAdamGroups})},
              options) {}

  /// The arrays of the map, which stay alive as long as one of them does.
  static py::typing::Dict<py::str, py::array> arrays(const py::object& self) {
    BasicGaussianMap<T>& map = self.cast<NumpyAdam&>().map_;
    const py::ssize_t n = map.size(), bases = map.sh_bases, dims = map.feature_dims;
    py::typing::Dict<py::str, py::array> result;
    const auto add = [&](const char* name, Array<T>& array, std::vector<py::ssize_t> shape) {
      result[name] = py::array_t<T>(std::move(shape), array.data(), self);
    };
    add("means", map.means, {n, 3});
    add("quats", map.quats, {n, 4});
    add("log_scales", map.log_scales, {n, 3});
    add("logit_opacities", map.logit_opacities, {n});
    add("sh", map.sh, {n, bases, 3});
    add("features", map.features, {n, dims});
    return result;
  }

  void step(const py::array& gradient_rows, const py::array& dL_dmeans, const py::array& dL_dquats,
            const py::array& dL_dlog_scales, const py::array& dL_dlogit_opacities,
            const py::array& dL_dsh, const py::array& dL_dfeatures, const AdamRates& rates,
            int threads) {
    const ExclusiveUse use(in_use_, "Adam");
    GradientsView<T> gradients;
    gradients.rows = require_array<std::uint32_t>(gradient_rows, "rows", {kAnyLength});
    const py::ssize_t n = gradient_rows.shape(0), bases = map_.sh_bases, dims = map_.feature_dims;
    gradients.size = static_cast<std::size_t>(n);
    gradients.sh_bases = map_.sh_bases;
    gradients.feature_dims = map_.feature_dims;
    gradients.dL_dmeans = require_array<T>(dL_dmeans, "dL_dmeans", {n, 3});
    gradients.dL_dquats = require_array<T>(dL_dquats, "dL_dquats", {n, 4});
    gradients.dL_dlog_scales = require_array<T>(dL_dlog_scales, "dL_dlog_scales", {n, 3});
    gradients.dL_dlogit_opacities =
        require_array<T>(dL_dlogit_opacities, "dL_dlogit_opacities", {n});
    gradients.dL_dsh = require_array<T>(dL_dsh, "dL_dsh", {n, bases, 3});
    gradients.dL_dfeatures = require_array<T>(dL_dfeatures, "dL_dfeatures", {n, dims});
    const py::gil_scoped_release release;
    adam_.step(map_, gradients, rates, threads);
  }

  using State = py::typing::Tuple<py::array_t<T>, py::array_t<T>, py::array_t<std::uint32_t>>;

  State state() {
    const ExclusiveUse use(in_use_, "Adam");
    return to_tuple(adam_.state());
  }

  State select(const py::array& selected) {
    const ExclusiveUse use(in_use_, "Adam");
    const auto* data = require_array<std::int64_t>(selected, "rows", {kAnyLength});
    return to_tuple(adam_.select({data, data + selected.size()}).state());
  }

 private:
  py::ssize_t rows() const { return static_cast<py::ssize_t>(map_.size()); }

  static State to_tuple(AdamState<T> state) {
    const auto n = static_cast<py::ssize_t>(state.steps.size() / kAdamGroups);
    const py::ssize_t parameters = 11 + 3 * state.sh_bases + state.feature_dims;
    return py::make_tuple(to_numpy(std::move(state.first), {n, parameters}),
                          to_numpy(std::move(state.second), {n, parameters}),
                          to_numpy(std::move(state.steps), {n, kAdamGroups}));
  }

  BasicGaussianMap<T> map_;
  Adam<T> adam_;
  bool in_use_ = false;
};

template <typename T>
void define_optimizer(py::module_& m, const char* name) {
  using Class = NumpyAdam<T>;
  py::class_<Class>(m, name, "Adam over a map of one precision; see gslts.rendering.adam.Adam.")
      .def(py::init<const GaussianView<T>&, const AdamOptions&>(), py::arg("gaussians"),
           py::kw_only(), py::arg("options"))
      .def(py::init<const GaussianView<T>&, const py::array&, const py::array&, const py::array&,
                    const AdamOptions&>(),
           py::arg("gaussians"), py::kw_only(), py::arg("first"), py::arg("second"),
           py::arg("steps"), py::arg("options"))
      .def(
          "arrays", [](const py::object& self) { return Class::arrays(self); },
          "Return the arrays of the map by name; they change with every step.")
      .def("step", &Class::step, py::kw_only(), py::arg("rows"), py::arg("dL_dmeans"),
           py::arg("dL_dquats"), py::arg("dL_dlog_scales"), py::arg("dL_dlogit_opacities"),
           py::arg("dL_dsh"), py::arg("dL_dfeatures"), py::arg("rates"),
           py::arg("threads").noconvert(), "Update the Gaussians at `rows`.")
      .def("state", &Class::state, "Return copies of the moments and steps.")
      .def("select", &Class::select, py::arg("rows"),
           "Return the state for a map whose Gaussian i was Gaussian rows[i], or is new if that is "
           "-1.");
}

}  // namespace

void define_optim_adam(py::module_ m) {
  const AdamOptions options;
  py::class_<AdamOptions>(m, "AdamOptions", R"(Constants of Adam; immutable.

Args:
    beta1: Decay of the first moment, in [0, 1).
    beta2: Decay of the second moment, in [0, 1).
    eps: Positive; 3DGS's value, as gradients of a mean over pixels are tiny.)")
      .def(py::init([](double beta1, double beta2, double eps) {
             return AdamOptions{beta1, beta2, eps};
           }),
           py::kw_only(), py::arg("beta1") = options.beta1, py::arg("beta2") = options.beta2,
           py::arg("eps") = options.eps)
      .def_readonly("beta1", &AdamOptions::beta1, "Decay of the first moment.")
      .def_readonly("beta2", &AdamOptions::beta2, "Decay of the second moment.")
      .def_readonly("eps", &AdamOptions::eps, "Added to the root of the second moment.")
      .def(py::pickle([](const AdamOptions& o) { return py::make_tuple(o.beta1, o.beta2, o.eps); },
                      [](const py::tuple& state) {
                        return AdamOptions{state[0].cast<double>(), state[1].cast<double>(),
                                           state[2].cast<double>()};
                      }));

  py::class_<AdamRates>(m, "AdamRates", R"(Learning rates by group of parameters; immutable.

A group with rate 0, its moments and its number of steps stay unchanged.

Args:
    means: Centres, m.
    quats: Rotations.
    log_scales: Logarithms of the scales.
    logit_opacities: Logits of the opacities.
    sh_dc: The three SH coefficients of degree 0.
    sh_rest: All other SH coefficients.
    features: Semantic features.)")
      .def(py::init([](double means, double quats, double log_scales, double logit_opacities,
                       double sh_dc, double sh_rest, double features) {
             return AdamRates{means, quats, log_scales, logit_opacities, sh_dc, sh_rest, features};
           }),
           py::kw_only(), py::arg("means") = 0.0, py::arg("quats") = 0.0,
           py::arg("log_scales") = 0.0, py::arg("logit_opacities") = 0.0, py::arg("sh_dc") = 0.0,
           py::arg("sh_rest") = 0.0, py::arg("features") = 0.0)
      .def_readonly("means", &AdamRates::means, "Centres, m.")
      .def_readonly("quats", &AdamRates::quats, "Rotations.")
      .def_readonly("log_scales", &AdamRates::log_scales, "Logarithms of the scales.")
      .def_readonly("logit_opacities", &AdamRates::logit_opacities, "Logits of the opacities.")
      .def_readonly("sh_dc", &AdamRates::sh_dc, "SH coefficients of degree 0.")
      .def_readonly("sh_rest", &AdamRates::sh_rest, "All other SH coefficients.")
      .def_readonly("features", &AdamRates::features, "Semantic features.")
      .def(py::pickle(
          [](const AdamRates& r) {
            return py::make_tuple(r.means, r.quats, r.log_scales, r.logit_opacities, r.sh_dc,
                                  r.sh_rest, r.features);
          },
          [](const py::tuple& state) {
            const auto r = state.cast<std::array<double, kAdamGroups>>();
            return AdamRates{r[0], r[1], r[2], r[3], r[4], r[5], r[6]};
          }));

  define_optimizer<float>(m, "AdamFloat");
  define_optimizer<double>(m, "AdamDouble");
}

}  // namespace gslts::python
