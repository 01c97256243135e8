#include "gslts/detect/surface.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "color_histogram.hpp"

namespace gslts::detect {

void validate(const Surface& surface, const char* function) {
  const auto require = [function](bool ok, const std::string& rule) {
    if (!ok) throw std::invalid_argument(std::string(function) + ": " + rule);
  };
  const auto finite = [&](const Eigen::Vector3d& values, const char* name) {
    require(values.allFinite(), std::string(name) + " must be finite");
  };
  finite(surface.point, "point");
  finite(surface.low, "low");
  finite(surface.high, "high");
  finite(surface.color, "color");
  for (const Eigen::Vector3d& sample : surface.samples) finite(sample, "samples");
  require((surface.low.array() <= surface.high.array()).all(), "low must not exceed high");
  require(surface.area_px >= 0 && surface.area_m2 >= 0, "area_px and area_m2 must be at least 0");
  require(std::isfinite(surface.area_m2) && std::isfinite(surface.step_m),
          "area_m2 and step_m must be finite");
  require(std::isfinite(surface.depth_m) && surface.depth_m >= 0,
          "depth_m must be finite and at least 0");
  const std::size_t bins = surface.color_histogram.size();
  require(bins == 0 || bins == kHistogramBins, "color_histogram must have 0 or " +
                                                   std::to_string(kHistogramBins) + " bins, got " +
                                                   std::to_string(bins));
}

}  // namespace gslts::detect
