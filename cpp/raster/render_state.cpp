#include "render_state.hpp"

#include <algorithm>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>

#include "chunks_in_view.hpp"
#include "gslts/parallel/parallel_for.hpp"

namespace gslts::raster {

template <typename T>
void require_finite_image(const char* name, const T* data, int channels,
                          const RenderSetup<T>& setup, const WantedPixels& wanted) {
  if (!data) return;
  const std::size_t width = std::size_t(setup.width), pixels = width * setup.height;
  for (std::size_t i = 0; i < pixels * std::size_t(channels); ++i) {
    if (data[i] * T(0) == T(0)) continue;
    const std::size_t pixel = i / channels;
    if (!wanted.pixel(int(pixel % width), int(pixel / width))) continue;
    std::ostringstream message;
    message << "Rasterizer::" << name << "[" << pixel / width << "," << pixel % width;
    if (channels > 1) message << "," << i % channels;
    message << "] is " << data[i] << ", must be finite";
    throw std::invalid_argument(message.str());
  }
}

template <typename T>
Images<T> RenderState<T>::render(const GaussianView<T>& gaussians) {
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
void RenderState<T>::project(const GaussianView<T>& gaussians) {
  splats.chunks = chunks_in_view(gaussians, *setup);
  if (gaussians.bounds && gaussians.bounds->load) gaussians.bounds->load(splats.chunks);
  const std::size_t chunks = splats.chunks.size();
  const std::size_t slots = std::min(chunks * kChunkSize, gaussians.size);
  splats.splats.resize(slots);
  splats.keys.resize(slots);
  splats.counts.assign(chunks, 0);
  splats.areas.assign(chunks, 0);
  std::vector<std::uint8_t> finite(chunks, 1);
  parallel::parallel_for(chunks, setup->threads, [&](std::size_t index) {
    finite[index] = project_chunk(gaussians, *setup, wanted, index, splats);
  });
  if (std::find(finite.begin(), finite.end(), 0) != finite.end()) {
    require_finite(gaussians, "Rasterizer::forward");
  }
}

template <typename T>
TileTask<T> RenderState<T>::tile_task(Band<T>& band, std::size_t tile) {
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
void RenderState<T>::blend_band(const GaussianView<T>& gaussians, Band<T>& band,
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
void RenderState<T>::require_forward_of(const GaussianView<T>& gaussians,
                                        const char* function) const {
  if (!setup) throw std::logic_error(std::string(function) + ": there was no forward");
  validate(gaussians, function);
  if (gaussians.size == map_size && gaussians.sh_bases == setup->sh_bases &&
      gaussians.feature_dims == setup->feature_dims) {
    return;
  }
  std::ostringstream message;
  message << function << ": gaussians must be those of the forward, " << map_size << " with "
          << setup->sh_bases << " SH bases and " << setup->feature_dims << " features, got "
          << gaussians.size << " with " << gaussians.sh_bases << " and " << gaussians.feature_dims;
  throw std::invalid_argument(message.str());
}

template <typename T>
std::vector<std::size_t> RenderState<T>::first_rows() const {
  std::vector<std::size_t> rows(splats.counts.size() + 1, 0);
  std::partial_sum(splats.counts.begin(), splats.counts.end(), rows.begin() + 1,
                   [](std::size_t a, std::size_t b) { return a + b; });
  return rows;
}

template struct RenderState<float>;
template void require_finite_image(const char*, const float*, int, const RenderSetup<float>&,
                                   const WantedPixels&);
template struct RenderState<double>;
template void require_finite_image(const char*, const double*, int, const RenderSetup<double>&,
                                   const WantedPixels&);

}  // namespace gslts::raster
