#pragma once

#include "gslts/io/ply.hpp"
#include "ply_header.hpp"
#include "ply_input.hpp"

namespace gslts::io {

/// Returns whether a file has the compressed layout of PlayCanvas and SuperSplat.
bool is_compressed(const Element& vertex);

/// Reads a map in the compressed layout, with the input at the first byte after the header.
///
/// Each 256 rows of `vertex` share a row of `chunk` with the bounds of positions, log scales and,
/// in newer files, colours. packed_position and packed_scale hold 11, 10 and 11 bits between the
/// bounds; packed_rotation the index of the largest component of the quaternion, wxyz, and 10 bits
/// for each of the others; packed_color 8 bits of red, green, blue and opacity. The rows of `sh`,
/// if there are any, hold 8 bits of each f_rest.
///
/// Source: the compressed PLY format of PlayCanvas, https://developer.playcanvas.com, and its
/// reader in splat-transform 2.7.
///
/// @throws std::runtime_error  as `read_ply`.
PlyContents read_compressed(const Header& header, const Element& vertex, Input& input);

}  // namespace gslts::io
