#pragma once

#include <cstddef>
#include <cstdint>

namespace gslts {

/// Half-open rectangle of pixels: columns [x0, x1) and rows [y0, y1).
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Non-owning view of the wanted pixels of an image: row-major [H,W], nonzero means wanted. Null
/// means all.
struct PixelMask {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0;  ///< px; of no importance where data is null.

  bool all() const { return data == nullptr; }
  bool pixel(int x, int y) const { return all() || data[std::size_t(y) * width + x] != 0; }
};

/// Checks that a mask belongs to an image; every public entry that takes one calls it.
/// @param width, height  Of the image, px.
/// @param function  Name of the caller, for the message.
/// @throws std::invalid_argument  if there is a mask, and it has another size.
void validate(const PixelMask& mask, int width, int height, const char* function);

/// Bounding box of the wanted pixels of an image; empty if none is wanted.
/// @param width, height  Of the image, px.
PixelBox bounds_of(const PixelMask& mask, int width, int height);

}  // namespace gslts
