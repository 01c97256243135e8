#include "gslts/align/normal_equations.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"

namespace gslts::align {
namespace {

/// Kinect's colours are good to some 2 %, and its depth to some 1 %; what is off by more than ten
/// and five times that belongs to another surface.
constexpr double kGreyStd = 0.02, kGreyOutlier = 0.25;
constexpr double kDepthStd = 0.01, kDepthOutlier = 0.05;
/// A relative step of the depth between neighbours that ends a surface.
constexpr double kDepthEdge = 0.05;
constexpr int kRowsPerTask = 8;
constexpr int kParameters = 10;

/// Means of 2 x 2 pixels; a depth is 0 unless all four were measured and wanted.
template <typename T>
struct Binned {
  Binned(int width_, int height_)
      : width(width_),
        height(height_),
        rendered_grey(std::size_t(width) * height),
        photo_grey(rendered_grey.size()),
        rendered_depth(rendered_grey.size()),
        measured_depth(rendered_grey.size()),
        wanted(rendered_grey.size()) {}

  int width, height;
  std::vector<T> rendered_grey, photo_grey, rendered_depth, measured_depth;
  std::vector<std::uint8_t> wanted;
};

template <typename T>
struct Source {
  const T *rgb, *depth, *photo, *measured;
  int width;
  PixelMask wanted;
  T gain[3], offset;  ///< The exposure, with a third of each channel making the grey.
};

template <typename T>
void bin_row(const Source<T>& source, int y, Binned<T>& binned) {
  const auto mean = [](const T(&value)[4]) {
    return (value[0] + value[1] + value[2] + value[3]) / 4;
  };
  for (int x = 0; x < binned.width; ++x) {
    T rendered[4], photo[4], depth[4], measured[4];
    bool has_depth = true, has_measured = true, wanted = true;
    for (int i = 0; i < 4; ++i) {
      const int u = 2 * x + i % 2, v = 2 * y + i / 2;
      const std::size_t pixel = std::size_t(v) * source.width + u;
      const T *color = source.rgb + 3 * pixel, *seen = source.photo + 3 * pixel;
      rendered[i] = source.gain[0] * color[0] + source.gain[1] * color[1] +
                    source.gain[2] * color[2] + source.offset;
      photo[i] = (seen[0] + seen[1] + seen[2]) / 3;
      depth[i] = source.depth[pixel];
      measured[i] = source.measured[pixel];
      has_depth &= depth[i] > 0;
      has_measured &= measured[i] > 0;
      wanted &= source.wanted.pixel(u, v);
    }
    const std::size_t bin = std::size_t(y) * binned.width + x;
    binned.rendered_grey[bin] = mean(rendered);
    binned.photo_grey[bin] = mean(photo);
    binned.rendered_depth[bin] = has_depth ? mean(depth) : T(0);
    binned.measured_depth[bin] = has_measured ? mean(measured) : T(0);
    binned.wanted[bin] = wanted;
  }
}

/// The upper triangle of H, row by row and padded to whole rows, and b.
template <typename T>
struct Sums {
  T hessian[kParameters][kParameters] = {};
  T right[kParameters] = {};

  void add(const T (&row)[kParameters], T residual, T weight) {
    for (int i = 0; i < kParameters; ++i) {
      const T scaled = weight * row[i];
      for (int j = 0; j < kParameters; ++j) hessian[i][j] += scaled * row[j];
      right[i] += scaled * residual;
    }
  }
};

template <typename T>
void add_to(NormalEquations& equations, const Sums<T>& sums) {
  for (int i = 0; i < kParameters; ++i) {
    for (int j = 0; j < kParameters; ++j) equations.hessian(i, j) += double(sums.hessian[i][j]);
    equations.right[i] += double(sums.right[i]);
  }
}

/// Derivatives of an image's value at a pixel by a twist of the camera, from `slope`, its change
/// for a shift of the camera (the opposite of one of the point).
template <typename T>
void write_twist(const T (&slope)[3], const T (&point)[3], T (&row)[kParameters]) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    row[i] = slope[i];
    row[3 + i] = point[j] * slope[k] - point[k] * slope[j];
  }
}

/// Huber's weight of a residual in units of its standard deviation; 0 for gross ones.
template <typename T>
T weight_of(T residual, double std, double outlier) {
  const T size = std::abs(residual);
  return size < T(outlier) ? T(1 / std) / std::max(size, T(std)) : T(0);
}

template <typename T>
void align_row(const Camera& camera, const Binned<T>& binned, int y, Sums<T>& color,
               Sums<T>& depth) {
  // Focal lengths in pixels of the image for the parameters, in bins for the slopes.
  const T fx = T(camera.fx), fy = T(camera.fy);
  const int width = binned.width;
  for (int x = 1; x + 1 < width; ++x) {
    const std::size_t bin = std::size_t(y) * width + x;
    const T z = binned.rendered_depth[bin];
    if (!(z > 0) || !binned.wanted[bin]) continue;
    const T point[3] = {(T(2 * x + 1) - T(camera.cx)) / fx * z,
                        (T(2 * y + 1) - T(camera.cy)) / fy * z, z};
    const auto slope_of = [&](const std::vector<T>& image, T(&slope)[3]) {
      const T right = (image[bin + 1] - image[bin - 1]) / 2;
      const T down = (image[bin + width] - image[bin - width]) / 2;
      slope[0] = right * fx / 2 / z;
      slope[1] = down * fy / 2 / z;
      slope[2] = -(slope[0] * point[0] + slope[1] * point[1]) / z;
    };
    T slope[3], row[kParameters];
    const T residual = binned.photo_grey[bin] - binned.rendered_grey[bin];
    const T weight = weight_of(residual, kGreyStd, kGreyOutlier);
    if (weight > 0) {
      slope_of(binned.rendered_grey, slope);
      write_twist(slope, point, row);
      // A longer focal length and another centre carry the point outwards.
      row[6] = -slope[0] * point[0];
      row[7] = -slope[1] * point[1];
      row[8] = -slope[0] * z / fx;
      row[9] = -slope[1] * z / fy;
      color.add(row, residual, weight);
    }
    const T measured = binned.measured_depth[bin];
    const T share = (measured - z) / z;
    const T depth_weight = measured > 0 ? weight_of(share, kDepthStd, kDepthOutlier) : T(0);
    if (!(depth_weight > 0)) continue;
    const std::vector<T>& rendered = binned.rendered_depth;
    T step = 0;
    for (const std::size_t near : {bin - 1, bin + 1, bin - width, bin + width}) {
      step = std::max(step, std::abs(rendered[near] - z));
    }
    if (step > T(kDepthEdge) * z) continue;
    slope_of(rendered, slope);
    slope[2] -= 1;  // A point that comes nearer also changes the depth itself.
    for (T& one : slope) one /= z;
    write_twist(slope, point, row);
    std::fill(row + 6, row + kParameters, T(0));
    depth.add(row, share, depth_weight);
  }
}

}  // namespace

template <typename T>
Alignment align(const Camera& camera, const T* rgb, const T* depth, const T* photo,
                const T* measured, const PixelMask& mask, const optim::Exposure& exposure,
                int threads) {
  const char* const function = "align";
  validate(camera, function);
  validate(mask, camera.width, camera.height, function);
  Source<T> source{rgb, depth, photo, measured, camera.width, mask, {}, T(0)};
  for (std::size_t c = 0; c < 3; ++c) {
    source.gain[c] = T(exposure.gain[c] / 3);
    source.offset += T(exposure.offset[c] / 3);
  }
  Binned<T> binned(camera.width / 2, camera.height / 2);
  const auto tasks = std::size_t(binned.height + kRowsPerTask - 1) / kRowsPerTask;
  const int workers = parallel::resolve_threads(threads);
  const auto last_row = [&](std::size_t task) {
    return std::min(binned.height, int(task + 1) * kRowsPerTask);
  };
  parallel::parallel_for(tasks, workers, [&](std::size_t task) {
    for (int y = int(task) * kRowsPerTask; y < last_row(task); ++y) bin_row(source, y, binned);
  });
  std::vector<Alignment> parts(tasks);
  parallel::parallel_for(tasks, workers, [&](std::size_t task) {
    Alignment part;
    for (int y = std::max(1, int(task) * kRowsPerTask); y < last_row(task); ++y) {
      if (y + 1 == binned.height) break;
      Sums<T> of_color, of_depth;
      align_row(camera, binned, y, of_color, of_depth);
      add_to(part.color, of_color);
      add_to(part.depth, of_depth);
    }
    parts[task] = part;
  });
  Alignment total;
  for (const Alignment& part : parts) {
    total.color.hessian += part.color.hessian;
    total.color.right += part.color.right;
    total.depth.hessian += part.depth.hessian;
    total.depth.right += part.depth.right;
  }
  return total;
}

template Alignment align(const Camera&, const float*, const float*, const float*, const float*,
                         const PixelMask&, const optim::Exposure&, int);
template Alignment align(const Camera&, const double*, const double*, const double*, const double*,
                         const PixelMask&, const optim::Exposure&, int);

}  // namespace gslts::align
