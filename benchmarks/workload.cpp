#include "workload.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <random>
#include <stdexcept>

namespace gslts::benchmarks {
namespace {

constexpr char kMagic[] = "GSLTSWL1";
constexpr std::size_t kShRestBases = 15;

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), file_(path, std::ios::binary) {
    if (!file_) throw std::runtime_error("read_workload: cannot open " + path_);
  }

  template <typename T, std::size_t N>
  std::array<T, N> read() {
    std::array<T, N> values;
    read(values.data(), N);
    return values;
  }

  template <typename T>
  void read(T* values, std::size_t count) {
    file_.read(reinterpret_cast<char*>(values), std::streamsize(count * sizeof(T)));
    if (!file_) throw std::runtime_error("read_workload: " + path_ + " is cut short");
  }

  /// Reads floats into an array of the precision of the benchmark.
  template <typename T>
  void read_floats(Array<T>& values) {
    if constexpr (std::is_same_v<T, float>) {
      read(values.data(), values.size());
    } else {
      Array<float> floats(values.size());
      read(floats.data(), floats.size());
      values.assign(floats.begin(), floats.end());
    }
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw std::runtime_error("read_workload: " + path_ + " " + message);
  }

 private:
  std::string path_;
  std::ifstream file_;
};

/// Appends the bases of degrees 1 to 3, row by row: the file holds them after those of degree 0, so
/// that degree 0 alone reads no more than it needs.
template <typename T>
void read_sh_rest(Reader& reader, BasicGaussianMap<T>& map, const Array<T>& dc) {
  std::array<float, kShRestBases * 3> rest;
  for (std::size_t row = 0; row < map.size(); ++row) {
    reader.read(rest.data(), rest.size());
    T* sh = map.sh.data() + row * (kShRestBases + 1) * 3;
    for (std::size_t c = 0; c < 3; ++c) sh[c] = dc[3 * row + c];
    for (std::size_t i = 0; i < rest.size(); ++i) sh[3 + i] = rest[i];
  }
}

}  // namespace

template <typename T>
raster::RenderOptions Workload<T>::options(int threads) const {
  raster::RenderOptions options;
  options.near_m = near_m;
  options.alpha_min = 1.0 / 255.0;  // That of 3DGS, with which the targets were set.
  options.threads = threads;
  return options;
}

template <typename T>
Workload<T> read_workload(const std::string& folder, const std::string& name, int sh_degree) {
  if (sh_degree != 0 && sh_degree != 3) {
    throw std::invalid_argument("read_workload: sh_degree must be 0 or 3, got " +
                                std::to_string(sh_degree));
  }
  Reader reader(folder + "/" + name + ".gslts-workload");
  if (std::memcmp(reader.read<char, 8>().data(), kMagic, 8) != 0) {
    reader.fail("is not a workload file");
  }
  const auto [size, width, height] = reader.read<std::uint64_t, 3>();
  const auto [fx, fy, cx, cy] = reader.read<double, 4>();
  const auto [near_m] = reader.read<double, 1>();
  const auto pose = reader.read<double, 16>();

  Workload<T> workload;
  workload.near_m = near_m;
  workload.camera = {fx, fy, cx, cy, int(width), int(height), Eigen::Isometry3d::Identity()};
  workload.camera.world_from_camera.matrix() =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(pose.data());
  workload.map = make_gaussian_map<T>(size, sh_degree == 0 ? 1 : int(kShRestBases) + 1);
  BasicGaussianMap<T>& map = workload.map;
  reader.read_floats(map.means);
  reader.read_floats(map.quats);
  reader.read_floats(map.log_scales);
  reader.read_floats(map.logit_opacities);
  if (sh_degree == 0) {
    reader.read_floats(map.sh);
  } else {
    Array<T> dc(3 * size);
    reader.read_floats(dc);
    read_sh_rest(reader, map, dc);
  }
  return workload;
}

template <typename T>
RandomImageGradients<T>::RandomImageGradients(std::size_t pixels)
    : rgb(3 * pixels), depth(pixels), alpha(pixels) {
  std::minstd_rand random(
      1);  // The standard fixes its sequence; that of the distributions it leaves open.
  for (Array<T>* image : {&rgb, &depth, &alpha}) {
    for (T& value : *image) value = T(random()) / T(std::minstd_rand::max()) - T(0.5);
  }
}

Region central_region(int width, int height, double share) {
  const int part_width = int(std::lround(width * std::sqrt(share)));
  const int part_height = int(std::lround(height * std::sqrt(share)));
  const int x0 = (width - part_width) / 2, y0 = (height - part_height) / 2;
  return {x0, y0, x0 + part_width, y0 + part_height};
}

std::vector<std::uint8_t> central_mask(int width, int height, double share) {
  std::vector<std::uint8_t> mask(std::size_t(width) * std::size_t(height), 0);
  const Region part = central_region(width, height, share);
  for (int y = part.y0; y < part.y1; ++y) {
    std::fill_n(mask.data() + std::size_t(y) * width + part.x0, part.x1 - part.x0, std::uint8_t(1));
  }
  return mask;
}

template struct Workload<float>;
template struct Workload<double>;
template struct RandomImageGradients<float>;
template struct RandomImageGradients<double>;
template Workload<float> read_workload(const std::string&, const std::string&, int);
template Workload<double> read_workload(const std::string&, const std::string&, int);

}  // namespace gslts::benchmarks
