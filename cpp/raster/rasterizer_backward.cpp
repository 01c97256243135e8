#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "gslts/parallel/parallel_for.hpp"
#include "render_state.hpp"

namespace gslts::raster {

namespace {

template <typename T>
void blend_band_backward(RenderState<T>& state, const GaussianView<T>& gaussians,
                         const ImageGradients<T>& image, Band<T>& band, bool statistics) {
  const RenderSetup<T>& setup = *state.setup;
  const std::size_t count = band.first_gradients.back();
  const int dims = image.dL_dfeatures ? setup.feature_dims : 0;
  state.entry_sums.resize(count * kSumsPerEntry);
  state.entry_features.resize(count * std::size_t(dims));
  state.entry_statistics.resize(statistics ? count * kStatisticsPerEntry : 0);
  const EntryGradients<T> out = {state.entry_sums.data(),
                                 dims ? state.entry_features.data() : nullptr,
                                 statistics ? state.entry_statistics.data() : nullptr};
  const std::size_t tiles = band.offsets.size() - 1;
  std::vector<std::uint8_t> finite(tiles, 1);
  parallel::parallel_for(tiles, setup.threads, [&](std::size_t tile) {
    const TileTask<T> task = state.tile_task(band, tile);
    if (!task.wanted) return;
    finite[tile] = blend_tile_backward(task, setup, state.splats.splats.data(), gaussians.features,
                                       state.wanted, image, out);
  });
  if (std::find(finite.begin(), finite.end(), 0) == finite.end()) return;
  const WantedPixels all;
  require_finite_image("backward: dL_drgb", image.dL_drgb, 3, setup, all);
  require_finite_image("backward: dL_ddepth", image.dL_ddepth, 1, setup, all);
  require_finite_image("backward: dL_dalpha", image.dL_dalpha, 1, setup, all);
  require_finite_image("backward: dL_dfeatures", image.dL_dfeatures, dims, setup, all);
}

/// Adds the sums of the tiles of a band to those of each splat of a chunk.
template <typename T>
void gather_chunk(const RenderState<T>& state, const Band<T>& band, std::size_t chunk,
                  std::size_t first_row, T* sums, Gradients<T>& gradients) {
  const std::size_t dims =
      state.entry_features.empty() ? 0 : std::size_t(state.setup->feature_dims);
  state.for_each_gradient(band, chunk, [&](std::uint32_t i, std::size_t index) {
    const std::size_t row = first_row + i;
    const T* part = state.entry_sums.data() + index * kSumsPerEntry;
    for (int k = 0; k < kSumsPerEntry; ++k) sums[std::size_t(i) * kSumsPerEntry + k] += part[k];
    for (std::size_t k = 0; k < dims; ++k) {
      gradients.dL_dfeatures[row * dims + k] += state.entry_features[index * dims + k];
    }
    if (!state.entry_statistics.empty()) {
      const T* statistics = state.entry_statistics.data() + index * kStatisticsPerEntry;
      gradients.abs_dL_dmeans2d[2 * row] += statistics[0];
      gradients.abs_dL_dmeans2d[2 * row + 1] += statistics[1];
      gradients.max_weights[row] = std::max(gradients.max_weights[row], statistics[2]);
      gradients.pixel_counts[row] += std::uint32_t(statistics[3]);
    }
  });
}

template <typename T>
Gradients<T> allocate_gradients(const RenderSetup<T>& setup, std::size_t visible, bool statistics) {
  Gradients<T> gradients;
  gradients.sh_bases = setup.sh_bases;
  gradients.feature_dims = setup.feature_dims;
  gradients.rows.resize(visible);
  gradients.dL_dmeans.resize(3 * visible);
  gradients.dL_dquats.resize(4 * visible);
  gradients.dL_dlog_scales.resize(3 * visible);
  gradients.dL_dlogit_opacities.resize(visible);
  gradients.dL_dsh.resize(visible * std::size_t(setup.sh_bases) * 3);
  gradients.dL_dfeatures.assign(visible * std::size_t(setup.feature_dims), T(0));
  if (statistics) {
    gradients.abs_dL_dmeans2d.assign(2 * visible, T(0));
    gradients.max_weights.assign(visible, T(0));
    gradients.pixel_counts.assign(visible, 0);
  }
  return gradients;
}

}  // namespace

template <typename T>
Gradients<T> Rasterizer<T>::backward(const GaussianView<T>& gaussians,
                                     const ImageGradients<T>& image_gradients, bool statistics) {
  RenderState<T>& state = *state_;
  state.require_forward_of(gaussians, "Rasterizer::backward");
  const RenderSetup<T>& setup = *state.setup;
  const std::vector<std::size_t> first_rows = state.first_rows();
  const std::size_t chunks = first_rows.size() - 1, visible = first_rows.back();
  Gradients<T> gradients = allocate_gradients<T>(setup, visible, statistics);
  std::vector<std::array<double, 6>> twists(chunks, std::array<double, 6>{});

  // With one band, the rule, a chunk's sums live only while its task runs.
  const bool one_band = state.bands.size() == 1;
  state.splat_sums.assign(one_band ? 0 : visible * kSumsPerEntry, T(0));
  for (Band<T>& band : state.bands) {
    if (!one_band) state.blend_band(gaussians, band, nullptr);
    blend_band_backward(state, gaussians, image_gradients, band, statistics);
    const bool last = &band == &state.bands.back();
    parallel::parallel_for(chunks, setup.threads, [&](std::size_t chunk) {
      const std::size_t count = state.splats.counts[chunk];
      static thread_local Array<T> chunk_sums;
      if (one_band) chunk_sums.assign(count * kSumsPerEntry, T(0));
      T* sums = one_band ? chunk_sums.data()
                         : state.splat_sums.data() + first_rows[chunk] * kSumsPerEntry;
      gather_chunk(state, band, chunk, first_rows[chunk], sums, gradients);
      if (!last) return;
      project_chunk_backward(gaussians, setup, state.splats.splats.data() + chunk * kChunkSize,
                             count, sums, first_rows[chunk], gradients, twists[chunk]);
    });
    if (!one_band) band.entries = {};
  }
  for (const std::array<double, 6>& twist : twists) {
    for (int i = 0; i < 6; ++i) gradients.dL_dtwist[i] += twist[i];
  }
  return gradients;
}

template <typename T>
GradientsView<T> Gradients<T>::view() const {
  const std::size_t size = rows.size();
  const auto checked = [&](const char* name, const Array<T>& gradient, std::size_t columns) {
    if (gradient.size() == size * columns) return gradient.data();
    std::ostringstream message;
    message << "Gradients::view: " << name << " must hold " << size << " x " << columns
            << " numbers, got " << gradient.size();
    throw std::invalid_argument(message.str());
  };
  return {size,
          sh_bases,
          feature_dims,
          rows.data(),
          checked("dL_dmeans", dL_dmeans, 3),
          checked("dL_dquats", dL_dquats, 4),
          checked("dL_dlog_scales", dL_dlog_scales, 3),
          checked("dL_dlogit_opacities", dL_dlogit_opacities, 1),
          checked("dL_dsh", dL_dsh, 3 * std::size_t(sh_bases)),
          checked("dL_dfeatures", dL_dfeatures, std::size_t(feature_dims))};
}

template GradientsView<float> Gradients<float>::view() const;
template GradientsView<double> Gradients<double>::view() const;
template Gradients<float> Rasterizer<float>::backward(const GaussianView<float>&,
                                                      const ImageGradients<float>&, bool);
template Gradients<double> Rasterizer<double>::backward(const GaussianView<double>&,
                                                        const ImageGradients<double>&, bool);

}  // namespace gslts::raster
