#include "gslts/raster/rasterizer.hpp"

#include <algorithm>
#include <numeric>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "binning.hpp"
#include "gslts/parallel/parallel_for.hpp"
#include "kernels.hpp"
#include "setup.hpp"
#include "splat.hpp"

namespace gslts::raster {
namespace {

/// Slots are numbered in 32 bits, with room for the arithmetic on them.
constexpr std::size_t kMaxGaussians = std::size_t{1} << 27;

/// Working memory of the tiles of one band; the backward pass goes on from it.
template <typename T>
struct BandMemory {
  Array<std::uint64_t> blocks;         ///< [entries]
  std::vector<std::uint32_t> reached;  ///< [tiles]
  std::vector<std::size_t> sums_of;    ///< [tiles] offset into sums
  Array<T> sums;                       ///< Of the tiles that have entries.
};

template <typename T>
void require_finite_gradient(const char* name, const T* data, std::size_t pixels, int channels,
                             int width) {
  if (!data) return;
  for (std::size_t i = 0; i < pixels * std::size_t(channels); ++i) {
    if (data[i] * T(0) == T(0)) continue;
    const std::size_t pixel = i / channels;
    std::ostringstream message;
    message << "Rasterizer::backward: " << name << "[" << pixel / width << "," << pixel % width;
    if (channels > 1) message << "," << i % channels;
    message << "] is " << data[i] << ", must be finite";
    throw std::invalid_argument(message.str());
  }
}

}  // namespace

template <typename T>
struct Rasterizer<T>::State {
  std::optional<RenderSetup<T>> setup;  ///< Of the last forward.
  std::size_t map_size = 0;
  WantedPixels wanted;
  Splats<T> splats;
  std::vector<Band<T>> bands;
  BandMemory<T> memory;  ///< Of the last band.
  Array<T> entry_sums, entry_features, entry_statistics, splat_sums;

  Images<T> render(const GaussianView<T>& gaussians);
  void project(const GaussianView<T>& gaussians);
  /// Writes the images too, unless null.
  void blend_band(const GaussianView<T>& gaussians, Band<T>& band, Images<T>* images);
  TileTask<T> tile_task(Band<T>& band, std::size_t tile);
  void blend_band_backward(const GaussianView<T>& gaussians, const ImageGradients<T>& image,
                           Band<T>& band, bool statistics);
  void gather_chunk(const Band<T>& band, std::size_t chunk, std::size_t first_row, T* sums,
                    Gradients<T>& gradients) const;
};

template <typename T>
Images<T> Rasterizer<T>::State::render(const GaussianView<T>& gaussians) {
  project(gaussians);
  bands = plan_bands(splats, *setup);
  Images<T> images;
  images.width = setup->width;
  images.height = setup->height;
  images.feature_dims = setup->feature_dims;
  const std::size_t pixels = std::size_t(setup->width) * setup->height;
  images.rgb.resize(3 * pixels);
  images.depth.resize(pixels);
  images.alpha.resize(pixels);
  images.features.resize(pixels * std::size_t(setup->feature_dims));
  for (Band<T>& band : bands) {
    blend_band(gaussians, band, &images);
    if (bands.size() > 1) band.entries = {};
  }
  return images;
}

template <typename T>
void Rasterizer<T>::State::project(const GaussianView<T>& gaussians) {
  const std::size_t chunks = (gaussians.size + kChunkSize - 1) / kChunkSize;
  splats.splats.resize(gaussians.size);
  splats.keys.resize(gaussians.size);
  splats.counts.assign(chunks, 0);
  splats.areas.assign(chunks, 0);
  std::vector<std::uint8_t> finite(chunks, 1);
  parallel::parallel_for(chunks, setup->threads, [&](std::size_t chunk) {
    finite[chunk] = project_chunk(gaussians, *setup, wanted, chunk, splats);
  });
  if (std::find(finite.begin(), finite.end(), 0) != finite.end()) {
    require_finite(gaussians, "Rasterizer::forward");
  }
}

template <typename T>
TileTask<T> Rasterizer<T>::State::tile_task(Band<T>& band, std::size_t tile) {
  const std::uint32_t first = band.offsets[tile];
  const int x = int(tile) % setup->tiles_x, y = band.first_row + int(tile) / setup->tiles_x;
  return {x,
          y,
          wanted.blocks(y * setup->tiles_x + x),
          band.entries.data() + first,
          memory.blocks.data() + first,
          band.offsets[tile + 1] - first,
          &memory.reached[tile],
          memory.sums.data() + memory.sums_of[tile]};
}

template <typename T>
void Rasterizer<T>::State::blend_band(const GaussianView<T>& gaussians, Band<T>& band,
                                      Images<T>* images) {
  bin_splats(splats, *setup, wanted, band);
  const std::size_t tiles = band.offsets.size() - 1;
  memory.blocks.resize(band.entries.size());
  memory.reached.assign(tiles, 0);
  memory.sums_of.assign(tiles, 0);
  std::size_t size = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    memory.sums_of[tile] = size;
    if (band.offsets[tile] < band.offsets[tile + 1]) size += tile_sums_size(setup->feature_dims);
  }
  memory.sums.resize(size);
  parallel::parallel_for(tiles, setup->threads, [&](std::size_t tile) {
    const TileTask<T> task = tile_task(band, tile);
    if (task.count) {
      blend_tile(task, *setup, splats.splats.data(), gaussians.features, wanted);
    }
    if (images) write_tile(task, *setup, wanted, *images);
  });
}

template <typename T>
void Rasterizer<T>::State::blend_band_backward(const GaussianView<T>& gaussians,
                                               const ImageGradients<T>& image, Band<T>& band,
                                               bool statistics) {
  const std::size_t places = band.first_gradients.back();
  const int dims = image.dL_dfeatures ? setup->feature_dims : 0;
  entry_sums.resize(places * kSumsPerEntry);
  entry_features.resize(places * std::size_t(dims));
  entry_statistics.resize(statistics ? places * kStatisticsPerEntry : 0);
  const EntryGradients<T> out = {entry_sums.data(), dims ? entry_features.data() : nullptr,
                                 statistics ? entry_statistics.data() : nullptr};
  const std::size_t tiles = band.offsets.size() - 1;
  std::vector<std::uint8_t> finite(tiles, 1);
  parallel::parallel_for(tiles, setup->threads, [&](std::size_t tile) {
    const TileTask<T> task = tile_task(band, tile);
    if (!task.wanted) return;
    finite[tile] = blend_tile_backward(task, *setup, splats.splats.data(), gaussians.features,
                                       wanted, image, out);
  });
  if (std::find(finite.begin(), finite.end(), 0) == finite.end()) return;
  const std::size_t pixels = std::size_t(setup->width) * setup->height;
  require_finite_gradient("dL_drgb", image.dL_drgb, pixels, 3, setup->width);
  require_finite_gradient("dL_ddepth", image.dL_ddepth, pixels, 1, setup->width);
  require_finite_gradient("dL_dalpha", image.dL_dalpha, pixels, 1, setup->width);
  require_finite_gradient("dL_dfeatures", image.dL_dfeatures, pixels, dims, setup->width);
}

/// Adds what the tiles of a band found for each splat of a chunk, in the order of the tiles.
template <typename T>
void Rasterizer<T>::State::gather_chunk(const Band<T>& band, std::size_t chunk,
                                        std::size_t first_row, T* sums,
                                        Gradients<T>& gradients) const {
  const std::size_t dims = entry_features.empty() ? 0 : std::size_t(setup->feature_dims);
  const SplatKey<T>* keys = splats.keys.data() + chunk * kChunkSize;
  std::size_t first_place = band.first_gradients[chunk];
  for (std::uint32_t i = 0; i < splats.counts[chunk]; ++i) {
    T* sum = sums + std::size_t(i) * kSumsPerEntry;
    const std::size_t row = first_row + i;
    const TileRect rect = clip(keys[i].rect, band);
    for_each_tile(rect, band, setup->tiles_x, wanted, [&](int, std::uint32_t rank) {
      const std::size_t place = first_place + rank;
      const T* part = entry_sums.data() + place * kSumsPerEntry;
      for (int k = 0; k < kSumsPerEntry; ++k) sum[k] += part[k];
      for (std::size_t k = 0; k < dims; ++k) {
        gradients.dL_dfeatures[row * dims + k] += entry_features[place * dims + k];
      }
      if (!entry_statistics.empty()) {
        const T* statistics = entry_statistics.data() + place * kStatisticsPerEntry;
        gradients.abs_dL_dmeans2d[2 * row] += statistics[0];
        gradients.abs_dL_dmeans2d[2 * row + 1] += statistics[1];
        gradients.max_weights[row] = std::max(gradients.max_weights[row], statistics[2]);
        gradients.pixel_counts[row] += std::uint32_t(statistics[3]);
      }
    });
    first_place += area(rect);
  }
}

template <typename T>
Rasterizer<T>::Rasterizer() : state_(std::make_unique<State>()) {}
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
  State& state = *state_;
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

template <typename T>
Gradients<T> Rasterizer<T>::backward(const GaussianView<T>& gaussians,
                                     const ImageGradients<T>& image_gradients, bool statistics) {
  State& state = *state_;
  if (!state.setup) throw std::logic_error("Rasterizer::backward: no forward to differentiate");
  const RenderSetup<T>& setup = *state.setup;
  validate(gaussians, "Rasterizer::backward");
  if (gaussians.size != state.map_size || gaussians.sh_bases != setup.sh_bases ||
      gaussians.feature_dims != setup.feature_dims) {
    std::ostringstream message;
    message << "Rasterizer::backward: gaussians must be those of the forward, " << state.map_size
            << " with " << setup.sh_bases << " SH bases and " << setup.feature_dims
            << " features, got " << gaussians.size << " with " << gaussians.sh_bases << " and "
            << gaussians.feature_dims;
    throw std::invalid_argument(message.str());
  }

  const std::size_t chunks = state.splats.counts.size();
  std::vector<std::size_t> first_rows(chunks + 1, 0);
  std::partial_sum(state.splats.counts.begin(), state.splats.counts.end(), first_rows.begin() + 1,
                   [](std::size_t a, std::size_t b) { return a + b; });
  const std::size_t visible = first_rows[chunks];
  Gradients<T> gradients;
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
  std::vector<std::array<double, 6>> twists(chunks, std::array<double, 6>{});

  // With one band, the rule, a chunk's sums live only while its task runs.
  const bool one_band = state.bands.size() == 1;
  state.splat_sums.assign(one_band ? 0 : visible * kSumsPerEntry, T(0));
  for (Band<T>& band : state.bands) {
    if (!one_band) state.blend_band(gaussians, band, nullptr);
    state.blend_band_backward(gaussians, image_gradients, band, statistics);
    const bool last = &band == &state.bands.back();
    parallel::parallel_for(chunks, setup.threads, [&](std::size_t chunk) {
      const std::size_t count = state.splats.counts[chunk];
      static thread_local Array<T> chunk_sums;
      if (one_band) chunk_sums.assign(count * kSumsPerEntry, T(0));
      T* sums = one_band ? chunk_sums.data()
                         : state.splat_sums.data() + first_rows[chunk] * kSumsPerEntry;
      state.gather_chunk(band, chunk, first_rows[chunk], sums, gradients);
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

template class Rasterizer<float>;
template class Rasterizer<double>;

}  // namespace gslts::raster
