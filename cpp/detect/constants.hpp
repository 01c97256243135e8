#pragma once

#include <array>
#include <cstddef>

#include "gslts/detect/regions.hpp"
#include "gslts/detect/surface.hpp"

// Fixed numbers of change detection. The thresholds that a user may change are in `MaskRule`,
// `ObjectRule` and `GsLtsRule`. Values without another source were chosen on simulated homes
// (benchmarks/results/detection.md); where it is not said what half and double of them do, it was
// not measured.

namespace gslts::detect {

// Images.

/// Scale of Sobel's 3 x 3 kernel, which sums eight differences of neighbouring pixels.
constexpr double kSobelScale = 1.0 / 8;

/// Minimum number of pixels of a median difference of depths; with fewer it counts as 0.
constexpr std::size_t kMinDepthPixels = 5;

/// Minimum of the settings, and of the noise of depths at 1 m, that divide depth steps and colour
/// changes: the quotients stay finite.
constexpr double kMinDivisor = 1e-6;

// Depth steps (depth_change.cpp).

/// Maximum depth step, in units of the smallest that counts: steps to depths near the largest float
/// stay finite.
constexpr double kMaxSteps = 1e9;

/// Maximum change of depth from pixel to pixel of a surface, as a share of the depth: with a
/// focal length of 300 px, 0.05 is a surface at 86 degrees to the image. Steeper ones are edges.
constexpr float kMaxSlope = 0.05f;

/// Side of the window, px, whose smallest slope is that of the surface: wider than an edge.
constexpr int kSlopeWindow_px = 7;

/// Depth steps of a pixel beside a certain one that count, in units of the smallest that counts
/// alone.
constexpr double kMinJoinedStep = 0.5;

// Parts of surfaces (changed_surfaces.cpp).

/// Side of the window, px, that joins parts of one object: the bars of a chair, say.
constexpr int kJoin_px = 3;

/// Maximum distance, m, of a flat surface from a raised one of which it is the shadow or a part.
constexpr double kShadow_m = 0.15;

/// Maximum distance of parts of one object: in m, and as a share of the size of the larger part, so
/// that small objects side by side stay apart.
constexpr double kMaxGap_m = 0.12, kMaxGapShare = 0.5;

// Flat changes (flat_change.cpp).

/// Maximum mean colour change around a flat object, as a share of that on it. Light that moved
/// fades out slowly: before, four of five false reports in 72 visits were light.
constexpr double kMaxOutlineShare = 0.5;

/// Rings around a region, in px from its outline, which may be misplaced by `kOutline_px`: where an
/// outline is looked for, and where depths around it are compared.
constexpr int kOutline_px = 2, kOutlineRing_px = 4, kDepthRing_px = 6;

/// Median difference of depths, m, beyond which a region is the rest of an object with depth.
constexpr double kMaxFlatHeight_m = 0.1;

/// Ratio of the colour changes of the two images from which the larger one tells the side.
constexpr double kMinColorRatio = 1.3;

/// Minimum share of the pixels of a flat surface of the map in which the frame has a depth.
constexpr double kMinMeasuredShare = 0.5;

// Surfaces (surface_of.cpp).

/// Quantile of the coordinates that is trimmed at either end of the box: stray pixels of an
/// outline.
constexpr double kTrimmedQuantile = 0.05;

/// Maximum number of points of a surface that are kept as samples: enough to tell which part of it
/// is where.
constexpr std::size_t kMaxSamples = 100;

/// Weight of a pixel in the colour histogram besides its colour change. At the edge of a surface
/// colours are mixed with the background, which both images show; weighing by the change reduced
/// the loss of the match score from 0.235 to 0.220 nats.
constexpr float kMinPixelWeight = 0.05f;

/// Maximum depth of a pixel of a surface, as a share of its median depth beyond it: at an outline
/// some pixels show the background.
constexpr double kMaxDepthSpread = 0.25;

/// Bins of the colour histogram: of either opponent axis, and, coarsely, as light and shade change
/// it, of brightness.
constexpr int kOpponentBins = 24, kBrightnessBins = 4;

// Evidence (evidence.cpp).

/// The ring around a surface in which the images are compared, px from its outline: what is nearer
/// may be its edge.
constexpr int kRingStart_px = 2, kRingEnd_px = 5;

/// The ring in which the surface's own depth may continue, px from its outline.
constexpr int kAttachedStart_px = 1, kAttachedEnd_px = 4;

/// Maximum step to a pixel in which the depth continues: m, and share of the depth.
constexpr double kAttachedStep_m = 0.01, kAttachedStepShare = 0.01;

/// Minimum number of pixels with depth that tell whether a surface is attached; with fewer the
/// share counts as `kUnknownAttached`.
constexpr int kMinAttachedPixels = 4;
/// Share that counts where it is unknown: neither attached nor free.
constexpr double kUnknownAttached = 0.5;

/// Added to colours before their ratio is taken: in the dark it tells nothing.
constexpr double kDark = 0.02;

/// Added to a colour change before it divides: a share of less tells nothing.
constexpr double kMinColorChange = 0.05;

/// Added to a product of variances before it divides.
constexpr double kTinyVariance = 1e-12;

// Confidence (confidence.cpp): see `confidence_features`. The offsets inside logarithms bound them
// where a measurement is 0.

/// Visibility counts added to either sort, so that few of them say little.
constexpr double kVisibilityPrior = 3;

/// Visibility counts taken where they are not known: typical ones of changed objects in the map, of
/// flat ones in the frame, and of others in the frame.
constexpr Visibility kTypicalBefore{975, 25, 1}, kTypicalFlatAfter{900, 100, 1},
    kTypicalAfter{150, 850, 1};

/// Added to the expected errors of rendered depth, m, and colour: those of the best maps.
constexpr double kMinDepthError_m = 0.003, kMinColorError = 0.02;

/// Share of pixels with changed colours that counts as all, as no object differs everywhere.
constexpr double kFullColorChange = 0.3;

/// Share of its value that a depth step keeps where no colour changed.
constexpr double kColorlessStep = 0.3;

/// Area, m^2, from which a flat surface is rather light than an object.
constexpr double kMaxFlatArea_m2 = 0.1;

/// Depth, m, below which a frame shows more detail than a map has.
constexpr double kNearDepth_m = 0.8;

/// Logistic regression found by benchmarks/fit_confidence.py on simulated homes, a foreign home and
/// a real room (benchmarks/results/detection.md).
constexpr double kConfidenceOffset = -18.337;
constexpr std::array<double, kConfidenceFeatures> kConfidenceWeights{
    2.063,   // depth step
    -0.330,  // colour step, flat
    -5.812,  // nearness
    -0.439,  // area in the image
    2.766,   // thickness
    -3.846,  // attached share
    1.626,   // residual colour
    -2.820,  // correlation, raised
    -4.364,  // correlation, flat
    -2.082,  // depth change around
    -8.295,  // colour change around, flat
    -3.579,  // large area, flat
    18.029,  // known visibility
    -0.186,  // seen through, in the map
    0.726,   // seen through, in the frame
    -3.118,  // in the map
    -1.923,  // expected error of the depth
    -0.539,  // expected error of the colours
};

// Light (color_constancy.cpp).

/// Standard deviation of the weights with which the gain is averaged, as a share of the width of
/// the image.
constexpr double kLightScale = 0.125;

/// Number of fits of the gain, each without what deviated in the one before.
constexpr int kLightFits = 3;

/// Share of the pixels of the first fit: those that deviate least.
constexpr double kFirstAgreeingShare = 0.7;

/// Maximum deviation of an agreeing pixel, in units of the median deviation, and the minimum of
/// that median: logarithm of a ratio.
constexpr double kMaxDeviation = 2.5, kMinDeviation = 0.05;

/// Added to colours before their ratio is taken, so that dark ones do not decide the gain.
constexpr double kDarkGain = 0.05;

/// Added to weights before they divide: where nothing agrees the gain is 1.
constexpr double kTinyWeight = 1e-3;

// Regions (regions.cpp).

/// Constants k of the fine and the coarse segmentation. Of four pairs and triples from 80 to 800,
/// no other finds more in real visits; 100 and 300 find 5 points less.
constexpr std::array<float, 2> kSegmentScales{150, 400};

/// Step in which differences of neighbours are counted, in units of L: less than is seen.
constexpr float kDifferenceStep = 1.0f / 16;

/// Standard deviation of the blur before the segmentation, px.
constexpr double kSegmentBlur_px = 0.6;

/// Weights of the axes a and b against L, and of a colour change of 1, in units of L. Twice the
/// weight of the change finds 5 points less in real visits, none at all 3 points.
constexpr float kHueWeight = 1.5f, kChangeWeight = 30;

/// Maximum size of a region, as a share of the image, and its minimum mean colour change.
constexpr double kMaxRegionShare = 0.25, kMinRegionChange = 0.08;

/// Maximum common part of two regions, as a share of the smaller one.
constexpr double kMaxOverlap = 0.3;

/// Maximum intersection over union of the boxes around two regions.
constexpr double kMaxBoxIou = 0.5;

/// Depth steps, m, of which each alone makes regions: less than the steps of 4 cm that the depth of
/// real visits has, as they are averaged over a few pixels, to twice as much, which parts objects.
constexpr std::array<float, 3> kRegionSteps_m{0.03f, 0.05f, 0.08f};

/// Side of the window, px, in which depth steps are averaged, and the largest one, m, that counts
/// there: it would grow into its surroundings.
constexpr int kStepWindow_px = 5;
constexpr float kMaxStep_m = 0.5f;

/// Median depth step of a region that counts in full, m: that of the depth itself.
constexpr double kFullStep_m = 0.04;

/// Added to colour changes and, in units of L, contrasts before their logarithm is taken.
constexpr double kTinyChange = 0.01, kTinyContrast = 1;

/// Logistic regression found by benchmarks/fit_region_confidence.py on real visits of three rooms.
/// The offset lets 0.15 other regions a frame reach 0.5 in rooms left out of the fit.
constexpr double kRegionOffset = 12.76;
constexpr std::array<double, kRegionFeatures> kRegionWeights{
    1.739,   // hue change
    -0.745,  // hue change around
    1.185,   // colour change
    0.982,   // contrast in the other image
    -2.076,  // the same in CIELAB, in which hue counts more
    1.969,   // thickness
    -1.058,  // aspect
    13.172,  // depth step
    -1.313,  // in the map
};

// Shifts (shifts.cpp).

/// Maximum motion that is searched, m and rad (8 degrees): beyond, an object was moved.
constexpr double kMaxShift_m = 0.15, kMaxShift_rad = 0.14;

/// Steps of the search on a grid, m and rad (4 degrees), and the stride of the points that it uses.
constexpr double kShiftStep_m = 0.03, kShiftStep_rad = 0.07;
constexpr std::size_t kShiftStride = 3;

/// Number of the best motions that are refined, and of rounds, each with half the step of the one
/// before.
constexpr std::size_t kShiftCandidates = 3;
constexpr int kShiftRounds = 3;

/// Maximum number of surfaces from which a shift is searched.
constexpr int kShiftSeeds = 4;

/// Maximum number of times that further surfaces join, each with a new search.
constexpr int kShiftJoins = 2;

/// Maximum number of points of a surface that are followed, and of steps: 1.5 m in steps of 3 cm.
constexpr std::size_t kShiftSamples = 40;
constexpr int kMaxShiftSteps = 50;

/// Distance, px, within which the other image may show a point: edges may be misplaced.
constexpr int kShiftTolerance_px = 1;

/// Maximum difference of depths at a point that both images show: kShiftDepth_m + kShiftDepthPerM
/// depth^2, m, besides the slope of the surface.
constexpr double kShiftDepth_m = 0.0125, kShiftDepthPerM = 0.003;

/// Minimum score of a shift. Of 88 reports in frames of a kitchen and the bookstore in which
/// objects came, went or moved farther, two had 0.12 and 0.2; of nudged ones most have 0.3 to 1.
constexpr double kMinShiftScore = 0.25;

/// Minimum score with which another surface joins: the motion is not fitted to it.
constexpr double kMinJoinedScore = 0.05;

/// Minimum share of the points of a surface at most `kMaxShift_m` from what was followed, with
/// which it is a part of the object.
constexpr double kMinShiftedShare = 0.8;

// Match of two surfaces (match_score.cpp), and of pairs (changes.cpp).

/// Minimum ratio of the lengths of one object at both ends of a relocation.
constexpr double kMinLengthRatio = 0.2;

/// Added to heights, m, before their ratio is taken: about the noise of depth.
constexpr double kTinyHeight_m = 0.02;

/// Maximum difference of the sum of a colour histogram from 1: rounding of its floats adds up to a
/// tenth of it.
constexpr double kMaxHistogramError = 1e-3;

/// Logistic regression found by benchmarks/fit_confidence.py: offset, and weights of the distance
/// of the colour histograms and of the growth in height. A sensor misses thin parts that the map
/// has, so that objects may shrink.
constexpr double kMatchOffset = 3.923;
constexpr std::array<double, 2> kMatchWeights{-8.102, -1.601};

/// Minimum confidence of the less certain end of a relocation, as a share of `min_confidence`.
constexpr double kMinEndConfidence = 0.2;

/// Share of the certain additions and removals that are one end of a relocation: in ten simulated
/// homes, 11.5 % of 346 were wrong.
constexpr double kLoneDoubt = 0.1;

/// Weight with which the odds that the less certain end is an error count against a match.
constexpr double kErrorWeight = 0.5;

}  // namespace gslts::detect
