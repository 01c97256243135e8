#pragma once

#include "gslts/simd/lanes.hpp"

// Every fixed number of the rasterizer, with its source. What a user may want to change is in
// `RenderOptions`.

namespace gslts::raster {

/// A tile is the unit of work of a thread and a block one SIMD step: 64 blocks a tile fit the bits
/// of one word, 16 pixels a block the lanes of one AVX-512 vector.
constexpr int kBlockSize = 4;
constexpr int kBlockPixels = kBlockSize * kBlockSize;
static_assert(kBlockPixels == simd::kLanes);
constexpr int kBlocksPerRow = 8;
constexpr int kBlocksPerTile = kBlocksPerRow * kBlocksPerRow;
constexpr int kLog2TileSize = 5;
constexpr int kTileSize = 1 << kLog2TileSize;
static_assert(kTileSize == kBlockSize * kBlocksPerRow);

/// Gaussians projected by one task; small enough for their parameters to stay in the L2 cache.
constexpr int kChunkSize = 4096;

/// Entries of the tile lists that are held at once, at least: beyond it an image is rendered in
/// several bands of tile rows, so that many screen-filling Gaussians cannot exhaust the memory.
constexpr long kMinBandEntries = 1L << 20;

/// Alpha never exceeds this, so that 1 / (1 - alpha) stays bounded (3DGS, Kerbl et al. 2023, app.
/// C).
constexpr double kMaxAlpha = 0.99;
constexpr double kLog2MaxAlpha = -0.014499569695115089;

/// The Jacobian of the projection is evaluated at most this share of the field of view outside the
/// image, where the affine approximation breaks down (Inria's rasterizer: 1.3 tan(fov / 2)).
constexpr double kJacobianMargin = 0.3;

/// A quaternion shorter than this has no direction worth the name and stands for no rotation.
constexpr double kMinQuatNorm = 1e-12;

/// exp(30) m is 1e13 m: larger scales only overflow.
constexpr double kMaxLogScale = 30.0;

/// Smallest slope, 1/px, of the whitening transform: a footprint of 1e18 px is flat.
constexpr double kMinSlope = 1e-18;

constexpr double kLn2 = 0.69314718055994530942;

/// Share of its depth by which the depth of a Gaussian may change within its footprint. Beyond, the
/// affine approximation is far off, and the depth of a pixel could become negative.
constexpr double kMostSlant = 0.5;

}  // namespace gslts::raster
