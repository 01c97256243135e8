#pragma once

#include <cstddef>
#include <cstdint>

#include "gslts/map/array.hpp"

namespace gslts {

/// Scatters rows into an array of zeros.
///
/// @param rows  [count] index of each row in the result, ascending.
/// @param values  [count,columns]
/// @return  [size,columns]
/// @throws std::invalid_argument  if `rows` do not ascend, or leave the array.
template <typename T>
Array<T> scatter_rows(const std::uint32_t* rows, const T* values, std::size_t count,
                      std::size_t columns, std::size_t size);

}  // namespace gslts
