#include "training_benchmark.hpp"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "gslts/optim/adam.hpp"
#include "gslts/optim/losses.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "workload.hpp"

namespace gslts::benchmarks {
namespace {

constexpr optim::AdamRates kRates = {1e-5, 1e-4, 1e-4, 1e-4, 1e-4, 1e-5, 0};
constexpr int kLiftDims = 32;

/// A measured image like the rendered one, as near the end of a training: for the losses.
Array<float> noisy(const Array<float>& rgb) {
  Array<float> target = rgb;
  std::uint32_t random = 1;
  for (float& value : target) {
    random = random * 1664525u + 1013904223u;
    value += 0.1f * (float(random >> 8) / float(1 << 24) - 0.5f);
  }
  return target;
}

/// A map on its way to look like an image.
class Training {
 public:
  /// In a region, as in a local update, the image is cropped to the mask, and only the Gaussians
  /// that show in it are in the map.
  Training(Workload<float> workload, int threads, bool region)
      : map_(std::move(workload.map)),
        camera_(workload.camera),
        options_(workload.options(threads)) {
    if (region) {
      const Region part = central_region(camera_.width, camera_.height, kRegionShare);
      camera_ = cropped(camera_, part.x0, part.y0, part.x1, part.y1);
      wanted_.assign(std::size_t(camera_.width) * camera_.height, 1);
      mask_ = {wanted_.data(), camera_.width, camera_.height};
    }
    forward();
    target_ = noisy(images_.rgb);
    target_depth_ = images_.depth;
    backward();
    if (region) {
      map_ = select(map_, {gradients_.rows.begin(), gradients_.rows.end()});
      forward();
      backward();
    }
    adam_ = std::make_unique<optim::Adam<float>>(map_.size(), map_.sh_bases, map_.feature_dims);
    features_.assign(std::size_t(camera_.width) * camera_.height * kLiftDims, 0.5f);
  }

  void forward() { images_ = rasterizer_.forward(map_.view(), camera_, options_, mask_); }
  void photometric_loss() {
    colour_ = optim::photometric_loss(images_.rgb.data(), target_.data(), camera_.width,
                                      camera_.height, mask_, 0.2, {}, options_.threads);
  }
  void depth_loss() {
    depth_ = optim::depth_loss(images_.depth.data(), target_depth_.data(), camera_.width,
                               camera_.height, mask_, options_.threads);
  }
  void fit_exposure() {
    benchmark::DoNotOptimize(optim::fit_exposure(images_.rgb.data(), target_.data(), camera_.width,
                                                 camera_.height, mask_, options_.threads));
  }
  void backward() {
    photometric_loss();
    depth_loss();
    gradients_ =
        rasterizer_.backward(map_.view(), {colour_.dL_drgb.data(), depth_.dL_ddepth.data()});
  }
  void adam() { adam_->step(map_, gradients_.view(), kRates, options_.threads); }
  void train() {
    forward();
    backward();
    adam();
  }
  void lift() {
    benchmark::DoNotOptimize(rasterizer_.lift(map_.view(), features_.data(), kLiftDims));
  }
  std::size_t visible() const { return gradients_.rows.size(); }

 private:
  BasicGaussianMap<float> map_;
  Camera camera_;
  raster::RenderOptions options_;
  std::vector<std::uint8_t> wanted_;
  PixelMask mask_;
  raster::Rasterizer<float> rasterizer_;
  raster::Images<float> images_;
  Array<float> target_, target_depth_, features_;
  optim::PhotometricLoss<float> colour_;
  optim::DepthLoss<float> depth_;
  raster::Gradients<float> gradients_;
  std::unique_ptr<optim::Adam<float>> adam_;
};

struct Piece {
  const char* name;
  void (Training::*run)();
  bool region = false;
};
constexpr Piece kPieces[] = {{"photometric_loss", &Training::photometric_loss},
                             {"depth_loss", &Training::depth_loss},
                             {"fit_exposure", &Training::fit_exposure},
                             {"adam", &Training::adam},
                             {"lift32", &Training::lift},
                             {"train", &Training::train},
                             {"region_train", &Training::train, true}};

}  // namespace

void add_training_benchmarks(const std::string& folder) {
  for (const std::string workload : {"S", "M", "L"}) {
    for (const int threads : {1, 2}) {
      for (const Piece& piece : kPieces) {
        const std::string name =
            piece.name + ("/" + workload) + "/sh:0/threads:" + std::to_string(threads);
        benchmark::RegisterBenchmark(name.c_str(),
                                     [=](benchmark::State& state) {
                                       Training training(read_workload<float>(folder, workload, 0),
                                                         threads, piece.region);
                                       (training.*piece.run)();  // Asks for its memory.
                                       for (auto _ : state) (training.*piece.run)();
                                       state.counters["visible"] = double(training.visible());
                                     })
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime();
      }
    }
  }
}

}  // namespace gslts::benchmarks
