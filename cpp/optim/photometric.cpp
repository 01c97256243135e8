#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "photometric.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include "photometric.hpp"

#include <algorithm>
#include <array>

#include "gslts/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::optim::HWY_NAMESPACE {

using namespace simd::HWY_NAMESPACE;  // Lanes and their sums.

// Rows are kept as 3 W numbers, colours interleaved, so that the window's taps are three numbers
// apart and all channels go the same way.
constexpr int kWindowRadius = 5, kWindowSize = 2 * kWindowRadius + 1;
/// Radius of the window in these numbers.
constexpr int kReach = 3 * kWindowRadius;
/// Place of a row's first number: at a cache line, behind the zeros that the window reaches.
constexpr int kFirst = 16;
static_assert(kFirst >= kReach);
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;  // Wang et al. 2004, sec. III-B

/// The window of SSIM: exp(-x^2 / (2 * 1.5^2)) at x = -5..5, with a sum of 1.
constexpr double kWindow[kWindowSize] = {
    0.0010283800844791099, 0.0075987581352391839, 0.036000772128430821, 0.10936068950970002,
    0.21300553771125369,   0.26601172486179437,   0.21300553771125369,  0.10936068950970002,
    0.036000772128430821,  0.0075987581352391839, 0.0010283800844791099};

template <typename T>
std::array<T, kWindowSize> window() {
  std::array<T, kWindowSize> result;
  for (int i = 0; i < kWindowSize; ++i) result[i] = T(kWindow[i]);
  return result;
}

/// Two rows go together through each step, which halves what is read of the rows around them.
constexpr int kRing = kWindowSize + 1;

/// The last kRing rows of something.
template <typename T>
class RowRing {
 public:
  void reset(std::size_t stride) {
    stride_ = stride;
    data_.assign(stride * kRing, T(0));
  }
  T* row(int y) { return data_.data() + std::size_t((y + 2 * kRing) % kRing) * stride_; }

 private:
  std::size_t stride_ = 0;
  Array<T> data_;
};

/// A number for each channel, repeated along a row.
template <typename T>
class ByChannel {
 public:
  explicit ByChannel(const T* values) {
    for (int i = 0; i < 2 * simd::kLanes; ++i) values_[i] = values[i % 3];
  }
  template <class D>
  HWY_INLINE hn::Vec<D> at(D d, std::size_t i) const {
    return hn::LoadU(d, values_ + i % 3);
  }

 private:
  T values_[2 * simd::kLanes];
};

template <typename T>
struct RowMemory {
  std::size_t stride;
  RowRing<T> x, y, mask;  ///< Rendered, measured, 1 where wanted.
  /// Sums over y of the window around each number of two rows: x, y, x^2 + y^2, x y, mask.
  Array<T> sums[2][5];
  Array<T> inverse_row_sums;  ///< 1 over the weight, in x, of the window inside the image.
  /// Derivatives with respect to the window's sums of x, x^2 + y^2 and x y, of one row, and
  /// smoothed in x, of the last rows.
  Array<T> factors[3];
  RowRing<T> smoothed[3];
};

/// Rows of the two images and of the mask, 0 where a pixel is not wanted or lies outside.
template <typename T>
void load_row(const PhotometricTask<T>& task, int y, RowMemory<T>& memory) {
  T *x_row = memory.x.row(y), *y_row = memory.y.row(y), *mask_row = memory.mask.row(y);
  for (T* row : {x_row, y_row, mask_row}) std::fill_n(row, memory.stride, T(0));
  if (y < 0 || y >= task.box.y1 - task.box.y0) return;
  const Lanes<T> d;
  const int columns = task.box.x1 - task.box.x0;
  const std::size_t at = 3 * (std::size_t(task.box.y0 + y) * task.width + task.box.x0);
  const T *rgb = task.rgb + at, *target = task.target + at;
  const std::size_t numbers = 3 * std::size_t(columns), lanes = hn::Lanes(d);
  const ByChannel<T> gains(task.gain), offsets(task.offset);
  std::copy_n(rgb, numbers, x_row + kFirst);
  for (std::size_t i = 0; i < numbers; i += lanes) {
    T* x = x_row + kFirst + i;
    hn::Store(hn::MulAdd(gains.at(d, i), hn::Load(d, x), offsets.at(d, i)), d, x);
  }
  std::fill(x_row + kFirst + numbers, x_row + memory.stride, T(0));  // The last vector's rest.
  std::copy_n(target, numbers, y_row + kFirst);
  std::fill_n(mask_row + kFirst, numbers, T(1));
  for (int x = 0; x < columns && !task.wanted.all(); ++x) {
    if (task.wanted.pixel(task.box.x0 + x, task.box.y0 + y)) continue;
    for (T* row : {x_row, y_row, mask_row}) std::fill_n(row + kFirst + 3 * x, 3, T(0));
  }
}

/// The window's sums over y around row `center` and the next.
template <bool kMasked, typename T>
void sum_columns(int center, const std::array<T, kWindowSize>& weights, RowMemory<T>& memory) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const T *x_rows[kRing], *y_rows[kRing], *mask_rows[kRing];
  for (int k = 0; k < kRing; ++k) {
    x_rows[k] = memory.x.row(center + k - kWindowRadius);
    y_rows[k] = memory.y.row(center + k - kWindowRadius);
    mask_rows[k] = memory.mask.row(center + k - kWindowRadius);
  }
  constexpr int kSums = kMasked ? 5 : 4;
  for (std::size_t i = 0; i < memory.stride; i += hn::Lanes(d)) {
    V sums[2][kSums];
    for (int s = 0; s < kSums; ++s) sums[0][s] = sums[1][s] = hn::Zero(d);
#pragma GCC unroll 12
    for (int k = 0; k < kRing; ++k) {
      const V x = hn::Load(d, x_rows[k] + i), y = hn::Load(d, y_rows[k] + i);
      V values[5] = {x, y, hn::MulAdd(x, x, y * y), x * y, x};
      if (kMasked) values[4] = hn::Load(d, mask_rows[k] + i);
      for (int s = 0; s < kSums; ++s) {
        if (k < kWindowSize) sums[0][s] = hn::MulAdd(hn::Set(d, weights[k]), values[s], sums[0][s]);
        if (k > 0) sums[1][s] = hn::MulAdd(hn::Set(d, weights[k - 1]), values[s], sums[1][s]);
      }
    }
    for (int row = 0; row < 2; ++row) {
      for (int s = 0; s < kSums; ++s) hn::Store(sums[row][s], d, memory.sums[row][s].data() + i);
    }
  }
}

/// The window's sum over x around number i of a row.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE hn::Vec<D> sum_row(D d, const T* row, std::size_t i,
                              const std::array<T, kWindowSize>& weights) {
  auto sum = hn::Zero(d);
  for (int k = 0; k < kWindowSize; ++k) {
    sum = hn::MulAdd(hn::Set(d, weights[k]), hn::LoadU(d, row + i + 3 * k - kReach), sum);
  }
  return sum;
}

/// The part of the window around `center` that lies in [0, size).
template <typename T>
T window_part(int center, int size, const std::array<T, kWindowSize>& weights) {
  T sum = 0;
  for (int k = 0; k < kWindowSize; ++k) {
    const int i = center + k - kWindowRadius;
    if (i >= 0 && i < size) sum += weights[k];
  }
  return sum;
}

/// SSIM around each number of a row, whose sum it returns, and the derivatives of
/// ssim_weight times it with respect to the window's sums of x, x^2 + y^2 and x y, into `factors`.
template <bool kMasked, typename T>
double similarity_row(const PhotometricTask<T>& task, int center, const Array<T>* sums,
                      const std::array<T, kWindowSize>& weights, RowMemory<T>& memory) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  // Without a mask, the window's part in the image is a product of one over x and one over y.
  const V inverse_rows = hn::Set(d, T(1) / window_part(center, task.box.y1 - task.box.y0, weights));
  const V zero = hn::Zero(d), one = hn::Set(d, T(1)), two = hn::Set(d, T(2));
  const V c1 = hn::Set(d, T(kC1)), c2 = hn::Set(d, T(kC2));
  const V weight = hn::Set(d, task.ssim_weight);
  const T* mask = memory.mask.row(center);
  const std::size_t end = std::size_t(kFirst + 3 * (task.box.x1 - task.box.x0));
  V totals[kVectors<Lanes<T>>];
  std::fill_n(totals, kVectors<Lanes<T>>, zero);
  for (std::size_t i = kFirst; i < end; i += hn::Lanes(d)) {
    const auto wanted = hn::Gt(hn::LoadU(d, mask + i), zero);
    V inverse;
    if (kMasked) {
      // Far above 1e-6 where the pixel itself is wanted.
      const V mask_sum = sum_row(d, sums[4].data(), i, weights);
      inverse = one / hn::Max(mask_sum, hn::Set(d, T(1e-6)));
    } else {
      inverse = inverse_rows * hn::Load(d, memory.inverse_row_sums.data() + i);
    }
    inverse = hn::IfThenElseZero(wanted, inverse);
    const V mean_x = sum_row(d, sums[0].data(), i, weights) * inverse;
    const V mean_y = sum_row(d, sums[1].data(), i, weights) * inverse;
    const V square = sum_row(d, sums[2].data(), i, weights) * inverse;
    const V product = sum_row(d, sums[3].data(), i, weights) * inverse;
    const V mean_product = mean_x * mean_y;
    const V mean_square = hn::MulAdd(mean_x, mean_x, mean_y * mean_y);
    const V a1 = hn::MulAdd(two, mean_product, c1);
    const V b1 = mean_square + c1;
    // Only by rounding is a variance negative, or a covariance larger than the variances allow.
    const V b2 = hn::Max(square - mean_square, zero) + c2;
    const V a2 = hn::Clamp(hn::MulAdd(two, product - mean_product, c2), hn::Neg(b2), b2);
    const V inverse_b = one / (b1 * b2);
    const V ssim = a1 * a2 * inverse_b;
    V& total = totals[i / hn::Lanes(d) % kVectors<Lanes<T>>];
    total = total + hn::IfThenElseZero(wanted, ssim);
    const V scale = weight * inverse;
    const V by_product = two * a1 * inverse_b;
    const V by_square = hn::Neg(ssim * b1 * inverse_b);
    const V by_mean =
        two * (mean_y * (a2 - a1) * inverse_b - mean_x * ssim * inverse_b * (b2 - b1));
    hn::StoreU(by_mean * scale, d, memory.factors[0].data() + i);
    hn::StoreU(by_square * scale, d, memory.factors[1].data() + i);
    hn::StoreU(by_product * scale, d, memory.factors[2].data() + i);
  }
  return double(sum_of(d, totals));
}

/// The gradients of row y and, unless it is `last`, the next, and their sums of absolute
/// differences.
template <typename T>
void gradient_rows(const PhotometricTask<T>& task, int y, int last,
                   const std::array<T, kWindowSize>& weights, RowMemory<T>& memory,
                   PhotometricSums* sums) {
  const Lanes<T> d;
  using V = hn::Vec<Lanes<T>>;
  const T* rows[3][kRing];
  for (int f = 0; f < 3; ++f) {
    for (int k = 0; k < kRing; ++k) rows[f][k] = memory.smoothed[f].row(y + k - kWindowRadius);
  }
  const V zero = hn::Zero(d), two = hn::Set(d, T(2)), l1 = hn::Set(d, task.l1_weight);
  const ByChannel<T> gains(task.gain);
  const std::size_t numbers = 3 * std::size_t(task.box.x1 - task.box.x0);
  const int count = std::min(2, last - y);
  V totals[2][kVectors<Lanes<T>>];
  for (auto& parts : totals) std::fill_n(parts, kVectors<Lanes<T>>, zero);
  const T *x_rows[2], *y_rows[2], *mask_rows[2];
  T* out_rows[2];
  for (int row = 0; row < 2; ++row) {
    x_rows[row] = memory.x.row(y + row) + kFirst;
    y_rows[row] = memory.y.row(y + row) + kFirst;
    mask_rows[row] = memory.mask.row(y + row) + kFirst;
    out_rows[row] =
        task.dL_drgb + 3 * (std::size_t(task.box.y0 + y + row) * task.width + task.box.x0);
  }
  const auto write = [&](int row, std::size_t i, const V* by) HWY_ATTR {
    const V x = hn::Load(d, x_rows[row] + i), measured = hn::Load(d, y_rows[row] + i);
    const V difference = x - measured;
    V& total = totals[row][i / hn::Lanes(d) % kVectors<Lanes<T>>];
    total = total + hn::Abs(difference);  // 0 behind the row.
    const V sign = hn::IfThenElseZero(hn::Ne(difference, zero), hn::CopySign(l1, difference));
    const V ssim = by[0] + hn::MulAdd(two * x, by[1], measured * by[2]);
    const V gradient = hn::IfThenElseZero(hn::Gt(hn::Load(d, mask_rows[row] + i), zero),
                                          (sign - ssim) * gains.at(d, i));
    if (i + hn::Lanes(d) <= numbers) {
      hn::StoreU(gradient, d, out_rows[row] + i);
    } else {
      HWY_ALIGN T rest[simd::kLanes];
      hn::Store(gradient, d, rest);
      std::copy_n(rest, numbers - i, out_rows[row] + i);
    }
  };
  for (std::size_t i = 0; i < numbers; i += hn::Lanes(d)) {
    V by[2][3];
    for (int f = 0; f < 3; ++f) {
      by[0][f] = by[1][f] = zero;
#pragma GCC unroll 12
      for (int k = 0; k < kRing; ++k) {
        const V value = hn::LoadU(d, rows[f][k] + kFirst + i);
        if (k < kWindowSize) by[0][f] = hn::MulAdd(hn::Set(d, weights[k]), value, by[0][f]);
        if (k > 0) by[1][f] = hn::MulAdd(hn::Set(d, weights[k - 1]), value, by[1][f]);
      }
    }
    write(0, i, by[0]);
    if (count == 2) write(1, i, by[1]);
  }
  for (int row = 0; row < count; ++row) {
    sums[y + row].l1 = double(sum_of(d, totals[row]));
  }
}

template <bool kMasked, typename T>
void photometric_rows(const PhotometricTask<T>& task, int first, int last, PhotometricSums* sums) {
  const Lanes<T> d;
  static thread_local RowMemory<T> memory;
  const std::array<T, kWindowSize> weights = window<T>();
  const int rows = task.box.y1 - task.box.y0, columns = task.box.x1 - task.box.x0;
  const std::size_t end = std::size_t(kFirst + 3 * (task.box.x1 - task.box.x0));
  memory.stride = (end + kReach) / simd::kLanes * simd::kLanes + 2 * simd::kLanes;
  for (RowRing<T>* ring : {&memory.x, &memory.y, &memory.mask}) ring->reset(memory.stride);
  for (RowRing<T>& ring : memory.smoothed) ring.reset(memory.stride);
  for (auto& row : memory.sums) {
    for (Array<T>& sum : row) sum.assign(memory.stride, T(0));
  }
  for (Array<T>& row : memory.factors) row.assign(memory.stride, T(0));
  memory.inverse_row_sums.assign(memory.stride, T(0));
  for (std::size_t i = kFirst; i < end; ++i) {
    memory.inverse_row_sums[i] = 1 / window_part(int(i - kFirst) / 3, columns, weights);
  }

  // Rows y and y + 1 enter; the similarity around the row a radius before, and the gradient of the
  // row two radii before, follow.
  for (int y = first - 2 * kWindowRadius; y < last + 2 * kWindowRadius; y += 2) {
    load_row(task, y, memory);
    load_row(task, y + 1, memory);
    const int center = y - kWindowRadius, done = y - 2 * kWindowRadius;
    if (center + 1 < first - kWindowRadius) continue;
    sum_columns<kMasked>(center, weights, memory);
    for (int row = 0; row < 2; ++row) {
      const int at = center + row;
      const bool inside = at >= 0 && at < rows;
      if (inside) {
        const double ssim = similarity_row<kMasked>(task, at, memory.sums[row], weights, memory);
        if (at >= first && at < last) sums[at].ssim = ssim;
      }
      for (int f = 0; f < 3; ++f) {
        T* out = memory.smoothed[f].row(at);
        for (std::size_t i = kFirst; i < end; i += hn::Lanes(d)) {
          hn::Store(inside ? sum_row(d, memory.factors[f].data(), i, weights) : hn::Zero(d), d,
                    out + i);
        }
      }
    }
    if (done >= first) gradient_rows(task, done, last, weights, memory, sums);
  }
}

void photometric_rows_float(const PhotometricTask<float>& task, int first, int last,
                            PhotometricSums* sums) {
  const auto rows = task.wanted.all() ? &HWY_NAMESPACE::photometric_rows<false, float>
                                      : &HWY_NAMESPACE::photometric_rows<true, float>;
  rows(task, first, last, sums);
}
void photometric_rows_double(const PhotometricTask<double>& task, int first, int last,
                             PhotometricSums* sums) {
  const auto rows = task.wanted.all() ? &HWY_NAMESPACE::photometric_rows<false, double>
                                      : &HWY_NAMESPACE::photometric_rows<true, double>;
  rows(task, first, last, sums);
}

}  // namespace gslts::optim::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::optim {

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

}  // namespace gslts::optim
#endif
