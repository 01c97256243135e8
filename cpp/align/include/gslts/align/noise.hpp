#pragma once

// Noise of RGB-D images against a rendered map: the one set of constants of direct image alignment,
// for mapping (`align`) and relocalization (`ViewCost`).

namespace gslts::align {

/// Standard deviation of the grey of an image, 0 to 1: Kinect's colours are good to 2 %.
inline constexpr double kGreyStd = 0.02;
/// Differences of grey or of a colour beyond it show another surface: about twelve times that.
inline constexpr double kGreyOutlier = 0.25;
/// Standard deviation of measured depth, relative: Kinect's depth is good to 1 %.
inline constexpr double kDepthStd = 0.01;
/// Relative differences of depth beyond it show another surface: five times that.
inline constexpr double kDepthOutlier = 0.05;
/// Relative step of depth between neighbouring pixels that ends a surface. Depth has no slope
/// there.
inline constexpr double kDepthEdge = 0.05;

/// Scales of Geman and McClure's loss, in standard deviations: of colour and of depth. Views that
/// are relocalized differ from the map by changed objects and light, not only by noise.
inline constexpr double kRobustColorStds = 4;
inline constexpr double kRobustDepthStds = 3;

}  // namespace gslts::align
