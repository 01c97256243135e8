// Times the rasterizer on the fixed workloads. See README.md.
//
//   gslts_raster_benchmark --workloads=DIR [--simd=avx2] [Google Benchmark's flags]
//   gslts_raster_benchmark --workloads=DIR --memory=M [--sh=3] [--threads=2]
//
// Names read pass/workload/sh:degree/threads:n, so that --benchmark_filter selects any part.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "fma_peak.hpp"
#include "gslts/raster/rasterizer.hpp"
#include "gslts/simd/target.hpp"
#include "memory.hpp"
#include "training_benchmark.hpp"
#include "workload.hpp"

namespace gslts::benchmarks {
namespace {

struct Arguments {
  std::string workloads = "build/bench/workloads";
  std::string simd;    ///< Empty: the best.
  std::string memory;  ///< Workload whose memory is measured instead of time.
  int sh = 0, threads = 1;
};

/// The last workload read: consecutive benchmarks share it, and only one at a time is in memory.
template <typename T>
const Workload<T>& cached_workload(const std::string& folder, const std::string& name,
                                   int sh_degree) {
  static std::string cached;
  static Workload<T> workload;
  const std::string key = folder + "/" + name + std::to_string(sh_degree);
  if (key != cached) {
    workload = {};
    workload = read_workload<T>(folder, name, sh_degree);
    cached = key;
  }
  return workload;
}

struct Case {
  std::string workload;
  int sh_degree, threads;
  bool backward = false, region = false;
};

template <typename T>
void run_case(benchmark::State& state, const std::string& folder, const Case& c) {
  const Workload<T>& workload = cached_workload<T>(folder, c.workload, c.sh_degree);
  const GaussianView<T> view = workload.map.view();
  const raster::RenderOptions options = workload.options(c.threads);
  const RandomImageGradients<T> image_gradients(workload.pixels());
  std::vector<std::uint8_t> pixels;
  PixelMask mask;
  if (c.region) {
    pixels = central_mask(workload.camera.width, workload.camera.height, kRegionShare);
    mask = {pixels.data(), workload.camera.width, workload.camera.height};
  }

  raster::Rasterizer<T> rasterizer;
  // The steady state of an optimisation: the working memory is there from the call before.
  rasterizer.forward(view, workload.camera, options, mask);
  const auto visible = rasterizer.backward(view, image_gradients.view()).rows.size();
  for (auto _ : state) {
    benchmark::DoNotOptimize(rasterizer.forward(view, workload.camera, options, mask));
    if (c.backward) {
      benchmark::DoNotOptimize(rasterizer.backward(view, image_gradients.view()));
    }
  }
  state.counters["visible"] = double(visible);
}

template <typename T>
void add_case(const std::string& pass, const std::string& folder, const Case& c) {
  const std::string name = pass + "/" + c.workload + "/sh:" + std::to_string(c.sh_degree) +
                           "/threads:" + std::to_string(c.threads);
  benchmark::RegisterBenchmark(
      name.c_str(), [folder, c](benchmark::State& state) { run_case<T>(state, folder, c); })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

void measure_fma(benchmark::State& state) {
  std::int64_t lanes = 0;
  for (auto _ : state) lanes += run_fma(100'000);
  state.counters["fma_lanes_per_s"] =
      benchmark::Counter(double(lanes), benchmark::Counter::kIsRate);
  state.counters["vector_lanes"] =
      benchmark::Counter(double(fma_lanes()), benchmark::Counter::kAvgThreads);
}

void add_benchmarks(const std::string& folder) {
  // Two threads show what the machine's second core adds when memory plays no part.
  benchmark::RegisterBenchmark("fma_peak", measure_fma)
      ->Unit(benchmark::kMillisecond)
      ->Threads(1)
      ->Threads(2)
      ->UseRealTime();
  for (const char* workload : {"S", "M", "L"}) {
    for (const int sh_degree : {0, 3}) {
      for (const int threads : {1, 2}) {
        add_case<float>("forward", folder, {workload, sh_degree, threads, false, false});
        add_case<float>("forward_backward", folder, {workload, sh_degree, threads, true, false});
      }
      if (sh_degree != 0) continue;
      add_case<float>("region_forward", folder, {workload, sh_degree, 1, false, true});
      add_case<float>("region_forward_backward", folder, {workload, sh_degree, 1, true, true});
    }
  }
  add_training_benchmarks(folder);
  add_case<double>("float64_forward", folder, {"M", 0, 1, false, false});
  add_case<double>("float64_forward_backward", folder, {"M", 0, 1, true, false});
}

/// Takes our arguments out of argv and leaves the rest to Google Benchmark.
Arguments parse(int& argc, char** argv) {
  Arguments arguments;
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto value_of = [&](const char* name) -> const char* {
      const std::string prefix = std::string("--") + name + "=";
      return argument.rfind(prefix, 0) == 0 ? argv[i] + prefix.size() : nullptr;
    };
    if (const char* folder = value_of("workloads")) {
      arguments.workloads = folder;
    } else if (const char* simd = value_of("simd")) {
      arguments.simd = simd;
    } else if (const char* memory = value_of("memory")) {
      arguments.memory = memory;
    } else if (const char* sh = value_of("sh")) {
      arguments.sh = std::stoi(sh);
    } else if (const char* threads = value_of("threads")) {
      arguments.threads = std::stoi(threads);
    } else {
      argv[kept++] = argv[i];
    }
  }
  argc = kept;
  return arguments;
}

void print_memory(const Arguments& arguments) {
  const MemoryUse use =
      measure_memory(arguments.workloads, arguments.memory, arguments.sh, arguments.threads);
  std::printf(
      "{\"workload\": \"%s\", \"sh\": %d, \"threads\": %d, \"visible\": %zu, \"pixels\": %zu, "
      "\"peak_bytes\": %zu, \"returned_bytes\": %zu, \"bound_bytes\": %.0f}\n",
      arguments.memory.c_str(), arguments.sh, arguments.threads, use.visible, use.pixels,
      use.peak_bytes, use.returned_bytes, use.bound_bytes());
}

int run(int argc, char** argv) {
  const Arguments arguments = parse(argc, argv);
  if (!arguments.simd.empty()) simd::use_target(arguments.simd);
  if (!arguments.memory.empty()) {
    print_memory(arguments);
    return 0;
  }
  add_benchmarks(arguments.workloads);
  benchmark::AddCustomContext("simd_target", simd::target());
  benchmark::AddCustomContext("compiler", GSLTS_COMPILER);
  benchmark::AddCustomContext("build_type", GSLTS_BUILD_TYPE);
  benchmark::AddCustomContext("flags", GSLTS_CXX_FLAGS);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace gslts::benchmarks

int main(int argc, char** argv) {
  try {
    return gslts::benchmarks::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gslts_raster_benchmark: %s\n", error.what());
    return 1;
  }
}
