#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "gslts/map/gaussian_map.hpp"

namespace gslts::io {

/// Contents of a PLY file.
struct PlyContents {
  GaussianMap map;
  /// Names of the properties of `vertex` that a map does not have; they were skipped.
  std::vector<std::string> ignored_properties;
};

/// Reads a map from a PLY file in the layout of 3DGS.
///
/// The element `vertex` has the properties x y z (`means`), f_dc_0..2 and f_rest_0..3(K-1)-1 (`sh`:
/// f_rest holds the K-1 coefficients of red, then those of green, then those of blue), opacity
/// (`logit_opacities`), scale_0..2 (`log_scales`) and rot_0..3 (`quats`, wxyz), in any order and of
/// any scalar type; nx ny nz are skipped. Extensions of 3DGS have names of their own: `features`
/// are feature_0..D-1, ids that are not 0, 1, ... are id_low and id_high (uint, 32 bits each), and
/// the origin is the comment `gslts origin X Y Z`. Files are ascii or binary of either byte order,
/// and may have other elements. Axes and units stay as they are.
///
/// Without that comment the origin is zero, or the median of the centres in whole metres if they
/// are of type double and 2,048 m or more away, where float would round them by 0.1 mm.
///
/// Other programs' variants: red green blue (uchar) for f_dc; an opacity of plus or minus infinity
/// and a scale of minus infinity, which become 20, -20 and -30; and the compressed layout of
/// PlayCanvas and SuperSplat.
///
/// @param path  A regular file. It is untrusted: no more memory is taken than its size justifies.
/// @throws std::system_error   naming the path, if the file cannot be opened or read.
/// @throws std::runtime_error  in one line that names the path, the header's line or the row and
///   property, and what is wrong with the contents.
PlyContents read_ply(const std::string& path);

/// Reads a map from the bytes of a PLY file; see `read_ply`.
/// @param name  Name of the bytes in messages.
/// @throws std::runtime_error  as `read_ply`.
PlyContents parse_ply(std::string_view bytes, const std::string& name);

/// Writes a map as binary little-endian PLY, from which `read_ply` returns the same bits.
///
/// The properties come in the order of 3DGS, with nx ny nz = 0 because some viewers require them,
/// then features and ids. The file is written under another name and renamed when it is complete:
/// other programs see the old file or the complete new one, and an error leaves the old one.
///
/// @param ids  [N] unique; null stands for 0, 1, ...
/// @param path  Path of the file; a symbolic link is followed.
/// @throws std::invalid_argument  if the view is invalid, a number is not finite, an id occurs
///   twice, or the features are so many, over 9,000, that their names do not fit into a header.
/// @throws std::system_error  naming the path, if the file cannot be written, or if the path is
///   there already but is no regular file.
void write_ply(const GaussianView<float>& gaussians, const std::uint64_t* ids,
               const std::string& path);

}  // namespace gslts::io
