#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "gslts/simd/lanes.hpp"

// Fixed numbers of the rasterizer, with their sources. What a user may want to change is in
// `RenderOptions`. Those of the first part only divide the work: halved or doubled, they change
// speed and memory, not the images.

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

/// Maximum number of Gaussians of a map: slots are numbered in 32 bits, with room for the
/// arithmetic on them.
constexpr std::size_t kMaxGaussians = std::size_t{1} << 27;

/// Entries of a tile that are blended before the next ones are read: what is kept of them stays in
/// the L1 cache, and a tile that has become opaque never reads the rest.
constexpr std::uint32_t kBatchSize = 512;
/// Words of a bit per entry of a batch.
constexpr std::uint32_t kBatchWords = kBatchSize / 64;

/// Minimum number of entries of the tile lists that one band holds. Beyond it an image is rendered
/// in several bands of tile rows, so that many screen-filling Gaussians cannot exhaust the memory.
constexpr long kMinBandEntries = 1L << 20;

/// Maximum number of entries of a band: they are numbered in 32 bits, with room for the scratch
/// entries of `bin_splats`.
constexpr std::uint64_t kMaxBandEntries = std::numeric_limits<std::uint32_t>::max() - (1u << 20);

/// Maximum number of channels that are lifted in one pass; more take further passes, so that the
/// memory for the sums of the entries stays bounded.
constexpr std::size_t kMaxLiftChannels = 64;

/// Maximum number of entries of a tile that are sorted by insertion, which is faster than a radix
/// sort for few.
constexpr std::size_t kMaxInsertionSort = 48;

/// Bits of a digit of the radix sort of a tile's entries: its histogram (2 kB) stays in the L1
/// cache.
constexpr int kSortDigitBits = 9;

/// Entries between the one at work and the one that is prefetched, in blending and in binning.
constexpr std::uint32_t kBlendPrefetch = 64;
constexpr std::uint32_t kBinPrefetch = 8;

// The following change what is rendered.

/// Maximum alpha, so that 1 / (1 - alpha) stays bounded (3DGS, Kerbl et al. 2023, app. C).
constexpr double kMaxAlpha = 0.99;
/// log2(kMaxAlpha).
constexpr double kLog2MaxAlpha = -0.014499569695115089;

/// The Jacobian of the projection is evaluated at most this share of the field of view outside the
/// image, where the affine approximation breaks down (Inria's rasterizer: 1.3 tan(fov / 2)).
constexpr double kJacobianMargin = 0.3;

/// Maximum share of its depth by which the depth of a Gaussian may change within its footprint.
/// Beyond, the affine approximation is far off, and the depth of a pixel could become negative: the
/// depth of the centre is taken.
constexpr double kMaxSlant = 0.5;

/// Minimum norm of a stored quaternion; a shorter one has no meaningful direction and stands for no
/// rotation.
constexpr double kMinQuatNorm = 1e-12;

/// Maximum logarithm of a scale: exp(30) m is 1e13 m, and larger scales only overflow.
constexpr double kMaxLogScale = 30.0;

/// Minimum slope of the whitening transform, 1/px: a footprint of 1e18 px is flat.
constexpr double kMinSlope = 1e-18;

// The following guard against rounding.

/// Share, and sum, by which squared radii of footprints are enlarged where pixels and blocks are
/// selected: float's rounding error is far below. Halved or doubled, no pixel changes.
constexpr double kRoundingMargin = 0.001;
static_assert(1 + kRoundingMargin == 1.001);

/// Smallest divisor: below, squares leave float's range.
constexpr double kTiny = 1e-30;

/// log(2): powers are computed to base 2.
constexpr double kLn2 = 0.69314718055994530942;

}  // namespace gslts::raster
