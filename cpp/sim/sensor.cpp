#include "gslts/sim/sensor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::sim {
namespace {

/// Relative step of depth between neighbouring pixels that counts as an edge.
constexpr double kEdgeStep = 0.03;

double clipped(double value) { return value > 0 ? (value < 1 ? value : 1.0) : 0.0; }

/// x^(1/2.4) for x in 1/512 to 1, to 1e-13, with the same bits on every machine, unlike the C
/// library: a table of 128 numbers per octave and a Taylor series between them.
class PowerTable {
 public:
  PowerTable() {
    for (std::size_t k = 0; k < kSize; ++k) {
      const std::uint64_t bits = ((kFirst + k) << kShift) + (std::uint64_t(1) << (kShift - 1));
      double center;
      std::memcpy(&center, &bits, sizeof center);
      entries_[k] = {1 / center, power(center)};
    }
  }

  double operator()(double x) const {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    const Entry& entry = entries_[(bits >> kShift) - kFirst];
    const double d = x * entry.inverse - 1;
    constexpr double p = 1 / 2.4, a = p * (p - 1) / 2, b = a * (p - 2) / 3, c = b * (p - 3) / 4;
    return entry.power * (1 + d * (p + d * (a + d * (b + d * c))));
  }

 private:
  struct Entry {
    double inverse, power;
  };
  static constexpr int kShift = 52 - 7;                                  // 128 steps an octave,
  static constexpr std::uint64_t kFirst = std::uint64_t(1023 - 9) << 7;  // from 2^-9,
  static constexpr std::size_t kSize = 9 * 128 + 1;                      // to 1.

  /// y with y^12 = x^5, by Newton's method from above, for x up to 1.01.
  static double power(double x) {
    const double x5 = x * x * x * x * x;
    double y = 1.01;
    for (int k = 0; k < 60; ++k) {
      const double y2 = y * y, y4 = y2 * y2, y11 = y4 * y4 * y2 * y;
      y -= (y * y11 - x5) / (12 * y11);
    }
    return y;
  }

  std::array<Entry, kSize> entries_;
};

double srgb_from_linear(double value, const PowerTable& power) {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * power(value) - 0.055;
}

/// Marks the pixels of a row that are next to a step of the depth: [W] 1, else 0.
std::vector<std::uint8_t> edges_of_row(const float* depth, std::size_t row, std::size_t width,
                                       std::size_t height) {
  std::vector<std::uint8_t> edges(width, 0);
  const float* here = depth + row * width;
  const auto mark = [&](const float* a, const float* b, std::size_t count, std::size_t first) {
    for (std::size_t i = 0; i < count; ++i) {
      const double from = double(a[i]), to = double(b[i]);
      edges[first + i] |= std::abs(to - from) > kEdgeStep * std::min(from, to);
    }
  };
  mark(here, here + 1, width - 1, 0);
  mark(here + 1, here, width - 1, 1);
  if (row > 0) mark(here, here - width, width, 0);
  if (row + 1 < height) mark(here, here + width, width, 0);
  return edges;
}

}  // namespace

Array<std::uint8_t> measure_color(const double* radiance, const double* normals, int width,
                                  int height, const ColorSensor& sensor, int threads) {
  static const PowerTable power;
  Array<std::uint8_t> rgb(3 * std::size_t(width) * std::size_t(height));
  parallel::parallel_for(std::size_t(height), threads, [&](std::size_t row) {
    const double y = (double(row) + 0.5) / height - 0.5;
    std::size_t at = 3 * row * std::size_t(width);
    for (int column = 0; column < width; ++column) {
      const double x = (column + 0.5) / width - 0.5;
      const double left = 1 - 2 * sensor.vignetting * (x * x + y * y);
      for (std::size_t k = 0; k < 3; ++k, ++at) {
        double value = srgb_from_linear(clipped(radiance[at] * sensor.gains[k] * left), power);
        if (normals) value += sensor.noise_std * normals[at];
        rgb[at] = std::uint8_t(std::nearbyint(255 * clipped(value)));
      }
    }
  });
  return rgb;
}

Array<float> measure_depth(const float* depth, const float* cosines, const double* normals,
                           const double* uniforms, int width, int height, const DepthSensor& sensor,
                           int threads) {
  const auto columns = std::size_t(width), rows = std::size_t(height);
  Array<float> result(columns * rows);
  parallel::parallel_for(rows, threads, [&](std::size_t row) {
    const std::vector<std::uint8_t> edges = edges_of_row(depth, row, columns, rows);
    for (std::size_t column = 0; column < columns; ++column) {
      const std::size_t at = row * columns + column;
      const double truth = double(depth[at]);
      const double std_m = sensor.std_m + sensor.std_per_m * (truth * truth);
      const double measured = truth + std_m * normals[at];
      const double chance = edges[column] ? sensor.edge_dropout : sensor.dropout;
      const bool lost = truth < sensor.near_m || truth > sensor.far_m ||
                        double(cosines[at]) < sensor.least_cosine || uniforms[at] < chance ||
                        truth == 0 || measured <= 0;
      result[at] = lost ? 0.0f : float(measured);
    }
  });
  return result;
}

}  // namespace gslts::sim
