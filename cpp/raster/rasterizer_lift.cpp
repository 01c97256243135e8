#include <algorithm>
#include <stdexcept>
#include <string>

#include "gslts/parallel/parallel_for.hpp"
#include "render_state.hpp"

namespace gslts::raster {
namespace {

template <typename T>
void lift_band(RenderState<T>& state, Band<T>& band, const LiftChannels<T>& image) {
  const std::size_t count = band.first_gradients.back();
  state.entry_features.resize(count * image.stride());
  state.entry_sums.resize(count);
  const EntryLifts<T> out = {state.entry_features.data(), state.entry_sums.data()};
  const std::size_t tiles = band.offsets.size() - 1;
  std::vector<std::uint8_t> finite(tiles, 1);
  parallel::parallel_for(tiles, state.setup->threads, [&](std::size_t tile) {
    finite[tile] = lift_tile(state.tile_task(band, tile), *state.setup, state.splats.splats.data(),
                             state.wanted, image, out);
  });
  if (std::find(finite.begin(), finite.end(), 0) == finite.end()) return;
  require_finite_image("lift: features", image.data, int(image.dims), *state.setup, state.wanted);
}

/// Adds the sums of the tiles of a band to those of each splat of a chunk.
template <typename T>
void gather_chunk(const RenderState<T>& state, const Band<T>& band, const LiftChannels<T>& image,
                  std::size_t chunk, std::size_t first_row, LiftedFeatures<T>& lifted) {
  state.for_each_gradient(band, chunk, [&](std::uint32_t i, std::size_t index) {
    const std::size_t row = first_row + i;
    const T* part = state.entry_features.data() + index * image.stride();
    T* sum = lifted.weighted_features.data() + row * image.dims + image.first;
    for (std::size_t k = 0; k < image.count; ++k) sum[k] += part[k];
    // Every pass over the channels sums the same weights.
    if (image.first == 0) lifted.weights[row] += state.entry_sums[index];
  });
}

}  // namespace

template <typename T>
LiftedFeatures<T> Rasterizer<T>::lift(const GaussianView<T>& gaussians, const T* features,
                                      int dims) {
  RenderState<T>& state = *state_;
  state.require_forward_of(gaussians, "Rasterizer::lift");
  if (dims < 1) {
    throw std::invalid_argument("Rasterizer::lift: dims must be at least 1, got " +
                                std::to_string(dims));
  }
  const std::vector<std::size_t> first_rows = state.first_rows();
  const std::size_t chunks = first_rows.size() - 1, visible = first_rows.back();
  LiftedFeatures<T> lifted;
  lifted.rows.resize(visible);
  lifted.weighted_features.assign(visible * std::size_t(dims), T(0));
  lifted.weights.assign(visible, T(0));
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const Splat<T>* splats = state.splats.splats.data() + chunk * kChunkSize;
    for (std::uint32_t i = 0; i < state.splats.counts[chunk]; ++i) {
      lifted.rows[first_rows[chunk] + i] = splats[i].gaussian;
    }
  }
  for (Band<T>& band : state.bands) {
    if (state.bands.size() > 1) state.blend_band(gaussians, band, nullptr);
    LiftChannels<T> image = {features, std::size_t(dims), 0, 0};
    for (; image.first < image.dims; image.first += image.count) {
      image.count = std::min(kMaxLiftChannels, image.dims - image.first);
      lift_band(state, band, image);
      parallel::parallel_for(chunks, state.setup->threads, [&](std::size_t chunk) {
        gather_chunk(state, band, image, chunk, first_rows[chunk], lifted);
      });
    }
    if (state.bands.size() > 1) band.entries = {};
  }
  return lifted;
}

template LiftedFeatures<float> Rasterizer<float>::lift(const GaussianView<float>&, const float*,
                                                       int);
template LiftedFeatures<double> Rasterizer<double>::lift(const GaussianView<double>&, const double*,
                                                         int);

}  // namespace gslts::raster
