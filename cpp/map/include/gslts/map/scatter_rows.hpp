#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts {

/// A row-major array of `size` rows with the given ones in their places, and zeros elsewhere.
///
/// @param rows  [count] where each row goes, ascending.
/// @param values  [count, columns]
/// @throws std::invalid_argument  if `rows` do not ascend, or leave the array.
template <typename T>
Array<T> scatter_rows(const std::uint32_t* rows, const T* values, std::size_t count,
                      std::size_t columns, std::size_t size);

}  // namespace gslts
