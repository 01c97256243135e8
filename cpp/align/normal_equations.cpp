#include "gslts/align/normal_equations.hpp"

#include <algorithm>
#include <vector>

#include "gslts/parallel/parallel_for.hpp"
#include "robust.hpp"
#include "surface_jacobian.hpp"

namespace gslts::align {
namespace {

/// Rows of one task.
constexpr int kRowsPerTask = 8;
/// Unknowns: six of the pose, and four intrinsics.
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

template <typename T>
using Sums = EquationSums<T, kParameters>;

template <typename T>
void add_to(NormalEquations& equations, const Sums<T>& sums) {
  for (int i = 0; i < kParameters; ++i) {
    for (int j = 0; j < kParameters; ++j) equations.hessian(i, j) += double(sums.hessian[i][j]);
    equations.right[i] += double(sums.right[i]);
  }
}

/// Adds the equation of the grey of a bin.
template <typename T>
void add_color(const Camera& camera, const Binned<T>& binned, std::size_t bin, Surface<T>& surface,
               Sums<T>& color) {
  const T residual = binned.photo_grey[bin] - binned.rendered_grey[bin];
  const T weight = huber_weight(residual, kGreyStd, kGreyOutlier);
  if (!(weight > 0)) return;
  const auto differences =
      central_differences(&binned.rendered_grey[bin], 1, std::ptrdiff_t(binned.width));
  surface.set_slope(differences.right, differences.down);
  T row[kParameters];
  surface.write_twist(row);
  // A longer focal length and another principal point carry the point outwards.
  const T *point = surface.point, *slope = surface.slope;
  row[6] = -slope[0] * point[0];
  row[7] = -slope[1] * point[1];
  row[8] = -slope[0] * point[2] / T(camera.fx);
  row[9] = -slope[1] * point[2] / T(camera.fy);
  color.add(row, residual, weight);
}

/// Adds the equation of the depth of a bin, relative to the rendered one.
template <typename T>
void add_depth(const Binned<T>& binned, std::size_t bin, Surface<T>& surface, Sums<T>& depth) {
  const std::ptrdiff_t width = binned.width;
  const T z = surface.point[2], measured = binned.measured_depth[bin];
  const T residual = (measured - z) / z;
  const T weight = measured > 0 ? huber_weight(residual, kDepthStd, kDepthOutlier) : T(0);
  if (!(weight > 0) || is_depth_edge(&binned.rendered_depth[bin], width)) return;
  const auto differences = central_differences(&binned.rendered_depth[bin], 1, width);
  surface.set_depth_slope(differences.right, differences.down, z);
  T row[kParameters] = {};  // Depth does not depend on the intrinsics.
  surface.write_twist(row);
  depth.add(row, residual, weight);
}

template <typename T>
void align_row(const Camera& camera, const Binned<T>& binned, int y, Sums<T>& color,
               Sums<T>& depth) {
  const T fx = T(camera.fx), fy = T(camera.fy);
  for (int x = 1; x + 1 < binned.width; ++x) {
    const std::size_t bin = std::size_t(y) * binned.width + x;
    const T z = binned.rendered_depth[bin];
    if (!(z > 0) || !binned.wanted[bin]) continue;
    Surface<T> surface{
        {(T(2 * x + 1) - T(camera.cx)) / fx * z, (T(2 * y + 1) - T(camera.cy)) / fy * z, z},
        fx / 2,  // In bins.
        fy / 2};
    add_color(camera, binned, bin, surface, color);
    add_depth(binned, bin, surface, depth);
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
