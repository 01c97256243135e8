// Rows of the map's arrays as vectors of columns, one Gaussian a lane. Included once per
// instruction set.

#if defined(GSLTS_RASTER_ROWS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef GSLTS_RASTER_ROWS_INL_HPP
#undef GSLTS_RASTER_ROWS_INL_HPP
#else
#define GSLTS_RASTER_ROWS_INL_HPP
#endif

#include <algorithm>
#include <cstddef>

#include "gslts/map/gaussian_map.hpp"
#include "simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

/// Loads kColumns columns of the rows rows[lane], in ascending order, of a row-major array.
/// Loads and shuffles beat the gather instructions of Zen 5, and NEON has none.
/// @param base  First column to load, in row 0.
/// @param end  End of the array.
/// @param stride  Numbers from one row to the next.
template <int kColumns, class D, typename T = hn::TFromD<D>, typename Row>
HWY_INLINE void gather_rows(D d, const T* base, const T* end, std::size_t stride, const Row* rows,
                            hn::Vec<D>* columns) {
  const std::size_t lanes = hn::Lanes(d);
  const auto row_of = [&](std::size_t lane) { return base + std::size_t(rows[lane]) * stride; };
  for (int column = 0; column < kColumns; column += 4) {
    hn::Vec<D> four[4];
    // Four numbers of the last row may reach beyond the array.
    if (kColumns % 4 == 0 || column + 4 <= kColumns || row_of(lanes - 1) + column + 4 <= end) {
      load_columns(
          d, [&](std::size_t lane) { return row_of(lane) + column; }, four);
    } else {
      HWY_ALIGN T values[4][kBlockPixels] = {};
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        for (int i = 0; column + i < kColumns; ++i) values[i][lane] = row_of(lane)[column + i];
      }
      for (int i = 0; i < 4; ++i) four[i] = hn::Load(d, values[i]);
    }
    for (int i = 0; i < 4 && column + i < kColumns; ++i) columns[column + i] = four[i];
  }
}

/// Loads the three columns of `valid` rows of an array [.,3]; the lanes beyond are 0.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void load_rows3(D d, const T* rows, std::size_t valid, hn::Vec<D>* columns) {
  if (valid == hn::Lanes(d)) {
    hn::LoadInterleaved3(d, rows, columns[0], columns[1], columns[2]);
    return;
  }
  T padded[3 * kBlockPixels] = {};
  std::copy_n(rows, 3 * valid, padded);
  hn::LoadInterleaved3(d, padded, columns[0], columns[1], columns[2]);
}

/// Stores three columns as the first `count` rows of an array [.,3].
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_rows3(D d, const hn::Vec<D>* columns, std::size_t count, T* out) {
  if (count == hn::Lanes(d)) {
    hn::StoreInterleaved3(columns[0], columns[1], columns[2], d, out);
    return;
  }
  HWY_ALIGN T rows[3 * kBlockPixels];
  hn::StoreInterleaved3(columns[0], columns[1], columns[2], d, rows);
  std::copy_n(rows, 3 * count, out);
}

/// Stores the first `count` lanes of a column as the rows of an array [.,1] or of one column of a
/// wider array.
template <class D, typename T = hn::TFromD<D>>
HWY_INLINE void store_column(D d, hn::Vec<D> column, std::size_t count, std::size_t stride,
                             T* out) {
  HWY_ALIGN T values[kBlockPixels];
  hn::Store(column, d, values);
  for (std::size_t lane = 0; lane < count; ++lane) out[lane * stride] = values[lane];
}

/// Prefetches the parameters of a Gaussian that will be projected soon.
template <typename T>
HWY_INLINE void prefetch(const GaussianView<T>& gaussians, std::size_t row) {
  __builtin_prefetch(gaussians.means + 3 * row);
  __builtin_prefetch(gaussians.quats + 4 * row);
  __builtin_prefetch(gaussians.log_scales + 3 * row);
}

/// Returns the rows of the map from `row` on.
template <typename T>
HWY_INLINE GaussianView<T> rows_from(GaussianView<T> gaussians, std::size_t row) {
  gaussians.size -= row;
  gaussians.means += 3 * row;
  gaussians.quats += 4 * row;
  gaussians.log_scales += 3 * row;
  gaussians.logit_opacities += row;
  gaussians.sh += row * std::size_t(gaussians.sh_bases) * 3;
  return gaussians;
}

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
