#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "photometric.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "losses.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

// Rows are kept as 3 W numbers, colours interleaved, so that the window's taps are three numbers
// apart and all channels go the same way.
constexpr int kWindowRadius = 5, kWindowSize = 2 * kWindowRadius + 1;
constexpr int kHalo = 3 * kWindowRadius;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;  // Wang et al. 2004, sec. III-B

template <typename T>
std::array<T, kWindowSize> window() {
  constexpr double kSigma = 1.5;
  std::array<double, kWindowSize> weights;
  double sum = 0;
  for (int i = 0; i < kWindowSize; ++i) {
    const double x = (i - kWindowRadius) / kSigma;
    sum += weights[i] = std::exp(-0.5 * x * x);
  }
  std::array<T, kWindowSize> result;
  for (int i = 0; i < kWindowSize; ++i) result[i] = T(weights[i] / sum);
  return result;
}

/// The last kWindowSize rows of an image, each with zeros around, as many as the window reaches and
/// a vector more; a row that lies outside is zero.
template <typename T>
class RowRing {
 public:
  void reset(std::size_t numbers) {
    stride_ = (numbers + 2 * kHalo + 2 * kBlockPixels) / kBlockPixels * kBlockPixels;
    data_.assign(stride_ * kWindowSize, T(0));
  }
  /// First number inside the halo is at [kHalo].
  T* row(int y) {
    return data_.data() + std::size_t((y + kWindowSize * 2) % kWindowSize) * stride_;
  }
  std::size_t stride() const { return stride_; }

 private:
  std::size_t stride_ = 0;
  Array<T> data_;
};

/// A number for each channel, repeated along a row.
template <typename T>
class ByChannel {
 public:
  explicit ByChannel(const T* values) {
    for (int i = 0; i < 2 * kBlockPixels; ++i) values_[i] = values[i % 3];
  }
  template <class D>
  HWY_INLINE hn::Vec<D> at(D d, std::size_t i) const {
    return hn::LoadU(d, values_ + i % 3);
  }

 private:
  T values_[2 * kBlockPixels];
};

template <typename T>
struct RowMemory {
  RowRing<T> x, y, mask;                      // Rendered, measured, 1 where wanted.
  RowRing<T> by_mean, by_square, by_product;  // dL / d of the window's means, smoothed in x.
  Array<T> sums[5], factors[3];
};

/// Rows of the two images and of the mask, 0 where a pixel is not wanted.
template <typename T>
void load_row(const PhotometricTask<T>& task, int y, RowMemory<T>& memory) {
  T *x_row = memory.x.row(y), *y_row = memory.y.row(y), *mask_row = memory.mask.row(y);
  const int columns = task.box.x1 - task.box.x0;
  if (y < 0 || y >= task.box.y1 - task.box.y0) {
    for (T* row : {x_row, y_row, mask_row}) std::fill_n(row, memory.x.stride(), T(0));
    return;
  }
  const Lanes<T> d;
  const std::size_t at = 3 * (std::size_t(task.box.y0 + y) * task.width + task.box.x0);
  const T *rgb = task.rgb + at, *target = task.target + at;
  const std::size_t numbers = 3 * std::size_t(columns), lanes = hn::Lanes(d);
  const ByChannel<T> gains(task.gain), offsets(task.offset);
  std::size_t i = 0;
  for (; i + lanes <= numbers; i += lanes) {
    hn::StoreU(hn::MulAdd(gains.at(d, i), hn::LoadU(d, rgb + i), offsets.at(d, i)), d,
               x_row + kHalo + i);
  }
  for (; i < numbers; ++i) x_row[kHalo + i] = task.gain[i % 3] * rgb[i] + task.offset[i % 3];
  std::copy_n(target, numbers, y_row + kHalo);
  std::fill_n(mask_row + kHalo, numbers, T(1));
  for (int x = 0; x < columns && !task.wanted->all(); ++x) {
    if (task.wanted->pixel(task.box.x0 + x, task.box.y0 + y)) continue;
    for (T* row : {x_row, y_row, mask_row}) std::fill_n(row + kHalo + 3 * x, 3, T(0));
  }
}

/// The window's sums over y of x, y, x^2 + y^2, x y and the mask.
template <typename T>
void sum_columns(int center, const std::array<T, kWindowSize>& weights, RowMemory<T>& memory) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const T *x_rows[kWindowSize], *y_rows[kWindowSize], *mask_rows[kWindowSize];
  for (int k = 0; k < kWindowSize; ++k) {
    x_rows[k] = memory.x.row(center + k - kWindowRadius);
    y_rows[k] = memory.y.row(center + k - kWindowRadius);
    mask_rows[k] = memory.mask.row(center + k - kWindowRadius);
  }
  for (std::size_t i = 0; i < memory.x.stride(); i += hn::Lanes(d)) {
    V x_sum = hn::Zero(d), y_sum = x_sum, square_sum = x_sum, product_sum = x_sum, mask_sum = x_sum;
    for (int k = 0; k < kWindowSize; ++k) {
      const V weight = hn::Set(d, weights[k]);
      const V x = hn::Load(d, x_rows[k] + i), y = hn::Load(d, y_rows[k] + i);
      const V wx = weight * x, wy = weight * y;
      x_sum = x_sum + wx;
      y_sum = y_sum + wy;
      square_sum = hn::MulAdd(wx, x, hn::MulAdd(wy, y, square_sum));
      product_sum = hn::MulAdd(wx, y, product_sum);
      mask_sum = hn::MulAdd(weight, hn::Load(d, mask_rows[k] + i), mask_sum);
    }
    hn::Store(x_sum, d, memory.sums[0].data() + i);
    hn::Store(y_sum, d, memory.sums[1].data() + i);
    hn::Store(square_sum, d, memory.sums[2].data() + i);
    hn::Store(product_sum, d, memory.sums[3].data() + i);
    hn::Store(mask_sum, d, memory.sums[4].data() + i);
  }
}

/// The window's sum over x around number i of a row.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<D> sum_row(D d, const T* row, std::size_t i,
                              const std::array<T, kWindowSize>& weights) {
  auto sum = hn::Zero(d);
  for (int k = 0; k < kWindowSize; ++k) {
    sum = hn::MulAdd(hn::Set(d, weights[k]), hn::LoadU(d, row + i + 3 * k - kHalo), sum);
  }
  return sum;
}

/// SSIM around each number of a row, whose sum it returns, and the derivatives of ssim_weight times
/// it with respect to the window's sums of x, x^2 + y^2 and x y, into `factors`.
template <typename T>
double similarity_row(const PhotometricTask<T>& task, int center,
                      const std::array<T, kWindowSize>& weights, RowMemory<T>& memory) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const V zero = hn::Zero(d), one = hn::Set(d, T(1)), two = hn::Set(d, T(2));
  const V c1 = hn::Set(d, T(kC1)), c2 = hn::Set(d, T(kC2));
  const V weight = hn::Set(d, task.ssim_weight);
  const T* mask = memory.mask.row(center);
  const std::size_t end = kHalo + 3 * std::size_t(task.box.x1 - task.box.x0);
  double total = 0;
  for (std::size_t i = kHalo; i < end; i += hn::Lanes(d)) {
    const auto wanted = hn::Gt(hn::LoadU(d, mask + i), zero);
    const V mask_sum = sum_row(d, memory.sums[4].data(), i, weights);
    const V inverse = hn::IfThenElseZero(wanted, one / hn::Max(mask_sum, hn::Set(d, T(1e-6))));
    const V mean_x = sum_row(d, memory.sums[0].data(), i, weights) * inverse;
    const V mean_y = sum_row(d, memory.sums[1].data(), i, weights) * inverse;
    const V square = sum_row(d, memory.sums[2].data(), i, weights) * inverse;
    const V product = sum_row(d, memory.sums[3].data(), i, weights) * inverse;
    const V mean_product = mean_x * mean_y;
    const V mean_square = hn::MulAdd(mean_x, mean_x, mean_y * mean_y);
    const V a1 = hn::MulAdd(two, mean_product, c1);
    const V b1 = mean_square + c1;
    // Only by rounding is a variance negative, or a covariance larger than the variances allow.
    const V b2 = hn::Max(square - mean_square, zero) + c2;
    const V a2 = hn::Clamp(hn::MulAdd(two, product - mean_product, c2), hn::Neg(b2), b2);
    const V inverse_b = one / (b1 * b2);
    const V ssim = a1 * a2 * inverse_b;
    total += double(hn::GetLane(hn::SumOfLanes(d, hn::IfThenElseZero(wanted, ssim))));
    const V scale = weight * inverse;
    const V by_product = two * a1 * inverse_b;
    const V by_square = hn::Neg(ssim * b1 * inverse_b);
    const V by_mean =
        two * (mean_y * (a2 - a1) * inverse_b - mean_x * ssim * inverse_b * (b2 - b1));
    hn::StoreU(by_mean * scale, d, memory.factors[0].data() + i);
    hn::StoreU(by_square * scale, d, memory.factors[1].data() + i);
    hn::StoreU(by_product * scale, d, memory.factors[2].data() + i);
  }
  return total;
}

/// The gradient of one row, and its sum of absolute differences.
template <typename T>
double gradient_row(const PhotometricTask<T>& task, int y,
                    const std::array<T, kWindowSize>& weights, RowMemory<T>& memory) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const T *mean_rows[kWindowSize], *square_rows[kWindowSize], *product_rows[kWindowSize];
  for (int k = 0; k < kWindowSize; ++k) {
    mean_rows[k] = memory.by_mean.row(y + k - kWindowRadius);
    square_rows[k] = memory.by_square.row(y + k - kWindowRadius);
    product_rows[k] = memory.by_product.row(y + k - kWindowRadius);
  }
  const V zero = hn::Zero(d), two = hn::Set(d, T(2)), l1 = hn::Set(d, task.l1_weight);
  const T *x_row = memory.x.row(y), *y_row = memory.y.row(y), *mask = memory.mask.row(y);
  const std::size_t numbers = 3 * std::size_t(task.box.x1 - task.box.x0);
  T* out = task.dL_drgb + 3 * (std::size_t(task.box.y0 + y) * task.width + task.box.x0);
  const ByChannel<T> gains(task.gain);
  double total = 0;
  for (std::size_t i = 0; i < numbers; i += hn::Lanes(d)) {
    V by_mean = zero, by_square = zero, by_product = zero;
    for (int k = 0; k < kWindowSize; ++k) {
      const V weight = hn::Set(d, weights[k]);
      by_mean = hn::MulAdd(weight, hn::LoadU(d, mean_rows[k] + kHalo + i), by_mean);
      by_square = hn::MulAdd(weight, hn::LoadU(d, square_rows[k] + kHalo + i), by_square);
      by_product = hn::MulAdd(weight, hn::LoadU(d, product_rows[k] + kHalo + i), by_product);
    }
    const V x = hn::LoadU(d, x_row + kHalo + i), measured = hn::LoadU(d, y_row + kHalo + i);
    const V difference = x - measured;
    total += double(hn::GetLane(hn::SumOfLanes(d, hn::Abs(difference))));
    const V sign = hn::IfThenElseZero(hn::Ne(difference, zero), hn::CopySign(l1, difference));
    const V ssim = by_mean + hn::MulAdd(two * x, by_square, measured * by_product);
    const V gradient = hn::IfThenElseZero(hn::Gt(hn::LoadU(d, mask + kHalo + i), zero),
                                          (sign - ssim) * gains.at(d, i));
    if (i + hn::Lanes(d) <= numbers) {
      hn::StoreU(gradient, d, out + i);
    } else {
      HWY_ALIGN T rest[kBlockPixels];
      hn::Store(gradient, d, rest);
      std::copy_n(rest, numbers - i, out + i);
    }
  }
  return total;
}

template <typename T>
void photometric_rows(const PhotometricTask<T>& task, int first, int last, PhotometricSums* sums) {
  const Lanes<T> d;
  static thread_local RowMemory<T> memory;
  const std::array<T, kWindowSize> weights = window<T>();
  const int rows = task.box.y1 - task.box.y0;
  const std::size_t numbers = 3 * std::size_t(task.box.x1 - task.box.x0);
  for (RowRing<T>* ring : {&memory.x, &memory.y, &memory.mask, &memory.by_mean, &memory.by_square,
                           &memory.by_product}) {
    ring->reset(numbers);
  }
  for (Array<T>& row : memory.sums) row.assign(memory.x.stride(), T(0));
  for (Array<T>& row : memory.factors) row.assign(memory.x.stride(), T(0));

  // Row `y` enters; the similarity around y - radius and the gradient of y - 2 radius follow.
  for (int y = first - 2 * kWindowRadius; y < last + 2 * kWindowRadius; ++y) {
    load_row(task, y, memory);
    const int center = y - kWindowRadius, done = y - 2 * kWindowRadius;
    if (center < first - kWindowRadius) continue;
    RowRing<T>* const rings[3] = {&memory.by_mean, &memory.by_square, &memory.by_product};
    if (center < 0 || center >= rows) {
      for (RowRing<T>* ring : rings) std::fill_n(ring->row(center), ring->stride(), T(0));
    } else {
      sum_columns(center, weights, memory);
      const double ssim = similarity_row(task, center, weights, memory);
      if (center >= first && center < last) sums[center].ssim = ssim;
      for (int k = 0; k < 3; ++k) {
        T* out = rings[k]->row(center);
        for (std::size_t i = kHalo; i < kHalo + numbers; i += hn::Lanes(d)) {
          hn::StoreU(sum_row(d, memory.factors[k].data(), i, weights), d, out + i);
        }
      }
    }
    if (done >= first) sums[done].l1 = gradient_row(task, done, weights, memory);
  }
}

void photometric_rows_float(const PhotometricTask<float>& task, int first, int last,
                            PhotometricSums* sums) {
  HWY_NAMESPACE::photometric_rows<float>(task, first, last, sums);
}
void photometric_rows_double(const PhotometricTask<double>& task, int first, int last,
                             PhotometricSums* sums) {
  HWY_NAMESPACE::photometric_rows<double>(task, first, last, sums);
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(photometric_rows_float);
HWY_EXPORT(photometric_rows_double);

template <>
void photometric_rows(const PhotometricTask<float>& task, int first, int last,
                      PhotometricSums* sums) {
  HWY_DYNAMIC_DISPATCH(photometric_rows_float)(task, first, last, sums);
}
template <>
void photometric_rows(const PhotometricTask<double>& task, int first, int last,
                      PhotometricSums* sums) {
  HWY_DYNAMIC_DISPATCH(photometric_rows_double)(task, first, last, sums);
}

}  // namespace gslts::raster
#endif
