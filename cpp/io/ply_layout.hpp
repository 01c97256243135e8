#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gslts/map/gaussian_map.hpp"

namespace gslts::io {

/// Memory layout, in a map, of a float property of `vertex`.
/// @tparam Number  float to read a file into them, const float to write them to one.
template <typename Number>
struct Column {
  std::string property;
  Number* first;       ///< Points to the value of Gaussian 0.
  std::size_t stride;  ///< Distance to the value of the next Gaussian.
};

inline float* data_of(Array<float>& array) { return array.data(); }
inline const float* data_of(const float* array) { return array; }

/// The columns of a `GaussianMap` or `GaussianView<float>` in the order of 3DGS, features last.
template <typename Number, typename Gaussians>
std::vector<Column<Number>> columns_of(Gaussians& gaussians) {
  std::vector<Column<Number>> columns;
  const auto add = [&](std::string property, auto& array, std::size_t index, std::size_t stride) {
    Number* const data = data_of(array);
    columns.push_back({std::move(property), data ? data + index : nullptr, stride});
  };
  const auto add_numbered = [&](const std::string& prefix, auto& array, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) add(prefix + std::to_string(i), array, i, count);
  };
  const std::size_t bases = static_cast<std::size_t>(gaussians.sh_bases);
  for (std::size_t i = 0; i < 3; ++i) add(std::string(1, "xyz"[i]), gaussians.means, i, 3);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    add("f_dc_" + std::to_string(channel), gaussians.sh, channel, bases * 3);
  }
  for (std::size_t channel = 0, i = 0; channel < 3; ++channel) {
    for (std::size_t basis = 1; basis < bases; ++basis, ++i) {
      add("f_rest_" + std::to_string(i), gaussians.sh, basis * 3 + channel, bases * 3);
    }
  }
  add("opacity", gaussians.logit_opacities, 0, 1);
  add_numbered("scale_", gaussians.log_scales, 3);
  add_numbered("rot_", gaussians.quats, 4);
  add_numbered("feature_", gaussians.features, static_cast<std::size_t>(gaussians.feature_dims));
  return columns;
}

/// An id that occurs twice, if there is one.
std::optional<std::uint64_t> repeated_id(const std::uint64_t* ids, std::size_t size);

}  // namespace gslts::io
