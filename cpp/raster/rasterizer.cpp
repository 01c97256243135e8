#include "gslts/raster/rasterizer.hpp"

#include <stdexcept>
#include <string>

#include "gslts/simd/target.hpp"
#include "render_state.hpp"

namespace gslts::raster {

template <typename T>
Rasterizer<T>::Rasterizer() : state_(std::make_unique<RenderState<T>>()) {
  simd::apply_environment();
}
template <typename T>
Rasterizer<T>::~Rasterizer() = default;
template <typename T>
Rasterizer<T>::Rasterizer(Rasterizer&&) noexcept = default;
template <typename T>
Rasterizer<T>& Rasterizer<T>::operator=(Rasterizer&&) noexcept = default;

template <typename T>
Images<T> Rasterizer<T>::forward(const GaussianView<T>& gaussians, const Camera& camera,
                                 const RenderOptions& options, const PixelMask& mask) {
  validate(gaussians, "Rasterizer::forward");
  if (gaussians.size > kMaxGaussians) {
    throw std::invalid_argument("Rasterizer::forward: gaussians.size must be at most 2^27, got " +
                                std::to_string(gaussians.size));
  }
  RenderState<T>& state = *state_;
  state.setup.reset();
  RenderSetup<T> setup = make_setup(gaussians, camera, options);
  state.wanted = WantedPixels(mask, setup.width, setup.height, "Rasterizer::forward");
  if (!state.wanted.all()) setup.region = state.wanted.bounds();
  state.map_size = gaussians.size;
  state.setup = setup;
  try {
    return state.render(gaussians);
  } catch (...) {
    state.setup.reset();  // A render that failed half-way cannot be differentiated.
    throw;
  }
}

template class Rasterizer<float>;
template class Rasterizer<double>;

}  // namespace gslts::raster
