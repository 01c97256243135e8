#include "gslts/map/scatter_rows.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace gslts {
namespace {

/// With kColumns at compile time, unless 0, a row takes one or two moves instead of a call.
template <int kColumns, typename T>
void copy_rows(const std::uint32_t* rows, const T* values, std::size_t count, std::size_t columns,
               T* out) {
  if (kColumns) columns = kColumns;
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(values + i * columns, columns, out + rows[i] * columns);
  }
}

}  // namespace

template <typename T>
Array<T> scatter_rows(const std::uint32_t* rows, const T* values, std::size_t count,
                      std::size_t columns, std::size_t size) {
  for (std::size_t i = 0; i < count; ++i) {
    if (rows[i] < size && (i == 0 || rows[i - 1] < rows[i])) continue;
    throw std::invalid_argument("scatter_rows: rows must ascend and stay below " +
                                std::to_string(size) + ", got " + std::to_string(rows[i]) + " at " +
                                std::to_string(i));
  }
  Array<T> out(size * columns);
  std::fill(out.begin(), out.end(), T(0));
  const auto copy = columns == 1   ? &copy_rows<1, T>
                    : columns == 3 ? &copy_rows<3, T>
                    : columns == 4 ? &copy_rows<4, T>
                                   : &copy_rows<0, T>;
  copy(rows, values, count, columns, out.data());
  return out;
}

template Array<float> scatter_rows(const std::uint32_t*, const float*, std::size_t, std::size_t,
                                   std::size_t);
template Array<double> scatter_rows(const std::uint32_t*, const double*, std::size_t, std::size_t,
                                    std::size_t);
template Array<std::uint32_t> scatter_rows(const std::uint32_t*, const std::uint32_t*, std::size_t,
                                           std::size_t, std::size_t);

}  // namespace gslts
