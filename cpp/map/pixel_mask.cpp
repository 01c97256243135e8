#include "gslts/map/pixel_mask.hpp"

#include <algorithm>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace gslts {

void validate(const PixelMask& mask, int width, int height, const char* function) {
  if (mask.all() || (mask.width == width && mask.height == height)) return;
  std::ostringstream message;
  message << function << ": mask is " << mask.width << " x " << mask.height
          << " pixels, but the image is " << width << " x " << height;
  throw std::invalid_argument(message.str());
}

PixelBox bounds_of(const PixelMask& mask, int width, int height) {
  if (mask.all()) return {0, 0, width, height};
  const auto is_wanted = [](std::uint8_t pixel) { return pixel != 0; };
  PixelBox bounds{width, height, 0, 0};
  for (int y = 0; y < height; ++y) {
    const std::uint8_t *row = mask.data + std::size_t(y) * width, *end = row + width;
    const std::uint8_t* first = std::find_if(row, end, is_wanted);
    if (first == end) continue;
    const auto last =
        std::find_if(std::make_reverse_iterator(end), std::make_reverse_iterator(row), is_wanted);
    bounds = {std::min(bounds.x0, int(first - row)), std::min(bounds.y0, y),
              std::max(bounds.x1, int(last.base() - row)), y + 1};
  }
  return bounds.x1 == 0 ? PixelBox{} : bounds;
}

}  // namespace gslts
