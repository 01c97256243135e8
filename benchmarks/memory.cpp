#include "memory.hpp"

#include <fstream>
#include <stdexcept>

#include "workload.hpp"

namespace gslts::benchmarks {
namespace {

/// A field of /proc/self/status, such as VmHWM, in bytes.
std::size_t process_bytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word != field + ":") continue;
    std::size_t kilobytes = 0;
    status >> kilobytes;
    return kilobytes * 1024;
  }
  throw std::runtime_error("measure_memory: /proc/self/status has no " + field);
}

void reset_peak() {
  std::ofstream clear("/proc/self/clear_refs");
  clear << "5" << std::flush;
  if (!clear) throw std::runtime_error("measure_memory: cannot write /proc/self/clear_refs");
}

/// Starts the threads and loads the code, which are no part of a rendering's memory.
void render_one_gaussian(const Workload<float>& workload, int threads) {
  GaussianView<float> one = workload.map.view();
  one.size = 1;
  Camera camera = workload.camera;
  camera.width = camera.height = 32;
  const RandomImageGradients<float> image_gradients(32 * 32);
  raster::Rasterizer<float> rasterizer;
  rasterizer.forward(one, camera, workload.options(threads));
  rasterizer.backward(one, image_gradients.view());
}

template <typename... Arrays>
std::size_t bytes_of(const Arrays&... arrays) {
  return ((arrays.size() * sizeof(*arrays.data())) + ...);
}

}  // namespace

MemoryUse measure_memory(const std::string& folder, const std::string& name, int sh_degree,
                         int threads) {
  const Workload<float> workload = read_workload<float>(folder, name, sh_degree);
  const RandomImageGradients<float> image_gradients(workload.pixels());
  render_one_gaussian(workload, threads);

  const std::size_t before = process_bytes("VmRSS");
  reset_peak();
  raster::Rasterizer<float> rasterizer;
  const GaussianView<float> view = workload.map.view();
  const auto images = rasterizer.forward(view, workload.camera, workload.options(threads));
  const auto gradients = rasterizer.backward(view, image_gradients.view());
  const std::size_t peak = process_bytes("VmHWM");

  MemoryUse use;
  use.visible = gradients.rows.size();
  use.pixels = workload.pixels();
  use.peak_bytes = peak - before;
  use.returned_bytes = bytes_of(images.rgb, images.depth, images.alpha, gradients.rows,
                                gradients.dL_dmeans, gradients.dL_dquats, gradients.dL_dlog_scales,
                                gradients.dL_dlogit_opacities, gradients.dL_dsh);
  return use;
}

}  // namespace gslts::benchmarks
