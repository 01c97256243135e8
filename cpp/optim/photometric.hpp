#pragma once

#include <cstddef>
#include <vector>

#include "gslts/map/array.hpp"
#include "gslts/optim/losses.hpp"

namespace gslts::optim {

/// A photometric loss, restricted to the bounding box of the wanted pixels.
template <typename T>
struct PhotometricTask {
  const T* rgb;
  const T* target;
  int width;     ///< Width of the images, px.
  PixelBox box;  ///< Bounding box of the wanted pixels.
  PixelMask wanted;
  T gain[3], offset[3];
  T l1_weight;    ///< Weight of each wanted number: (1 - lambda) / count
  T ssim_weight;  ///< Likewise: lambda / count
  T* dL_drgb;     ///< [H,W,3]; only the box is written.
};

/// Sums over wanted numbers of one row.
struct PhotometricSums {
  double l1 = 0, ssim = 0;
};

/// Writes the gradient of the rows [first, last) of the box, and the sums of row y to sums[y].
template <typename T>
void photometric_rows(const PhotometricTask<T>& task, int first, int last, PhotometricSums* sums);

}  // namespace gslts::optim
