#pragma once

#include <gtest/gtest.h>

#include "gslts/raster/rasterizer.hpp"

namespace gslts::raster::testing {

/// Everything that one render and its backward pass return.
template <typename T>
struct Result {
  Images<T> images;
  Gradients<T> gradients;
};

template <typename T>
void expect_identical(const Result<T>& a, const Result<T>& b) {
  EXPECT_EQ(a.images.rgb, b.images.rgb);
  EXPECT_EQ(a.images.depth, b.images.depth);
  EXPECT_EQ(a.images.alpha, b.images.alpha);
  EXPECT_EQ(a.images.features, b.images.features);
  EXPECT_EQ(a.gradients.rows, b.gradients.rows);
  EXPECT_EQ(a.gradients.dL_dmeans, b.gradients.dL_dmeans);
  EXPECT_EQ(a.gradients.dL_dquats, b.gradients.dL_dquats);
  EXPECT_EQ(a.gradients.dL_dlog_scales, b.gradients.dL_dlog_scales);
  EXPECT_EQ(a.gradients.dL_dlogit_opacities, b.gradients.dL_dlogit_opacities);
  EXPECT_EQ(a.gradients.dL_dsh, b.gradients.dL_dsh);
  EXPECT_EQ(a.gradients.dL_dfeatures, b.gradients.dL_dfeatures);
  EXPECT_EQ(a.gradients.dL_dtwist, b.gradients.dL_dtwist);
  EXPECT_EQ(a.gradients.abs_dL_dmeans2d, b.gradients.abs_dL_dmeans2d);
  EXPECT_EQ(a.gradients.max_weights, b.gradients.max_weights);
  EXPECT_EQ(a.gradients.pixel_counts, b.gradients.pixel_counts);
}

}  // namespace gslts::raster::testing
