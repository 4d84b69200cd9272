#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <isobrick/brick_codec.h>
#include <isobrick/downsampling.h>
#include <isobrick/extract.h>
#include <isobrick/open_source.h>
#include <isobrick/part.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include "core/half_space.h"

// The values of the command line: text to meaning. Every function throws
// UsageError with a line that names what was given and what is valid.
namespace isobrick::tools {

/// "100000", "64K", "512M", "1.5G", "2T", "1GiB": binary units.
std::uint64_t parse_bytes(std::string_view text);

/// A whole number in [least, most].
Index parse_whole(std::string_view text, Index least, Index most);

/// The same for an int.
inline int parse_int(std::string_view text, int least, int most) {
  return static_cast<int>(parse_whole(text, least, most));
}

/// A position in a file.
std::uint64_t parse_offset(std::string_view text);

/// A finite number.
double parse_number(std::string_view text);

/// "X,Y,Z", every part at least 1.
Int3 parse_dims(std::string_view text);

/// "X,Y,Z", finite numbers.
Vec3d parse_vector(std::string_view text);

/// "NX,NY,NZ,D": what lies where NX·x + NY·y + NZ·z >= D.
HalfSpace parse_half_space(std::string_view text);

/// "X0:X1,Y0:Y1,Z0:Z1", a box of world space that has an inside; any number, or a whole part, may
/// be left out.
WorldRegion parse_world_region(std::string_view text);

/// "2" along all axes, or "X,Y,Z"; each at least 1.
Int3 parse_stride(std::string_view text);

/// "1500", "1.5M", "20k", "2G": a count, with decimal units.
std::uint64_t parse_count(std::string_view text);

/// Pixels, "WIDTHxHEIGHT".
struct PictureSize {
  int width, height;
};
PictureSize parse_picture_size(std::string_view text);

/// "auto", "cpu" or "cuda".
Backend parse_backend(std::string_view text);

/// "I/N": part I of N.
Part parse_part(std::string_view text);

/// "above" or "below".
Inside parse_inside(std::string_view text);

/// "consistent" or "trilinear".
Topology parse_topology(std::string_view text);

/// "gradient" (true) or "none".
bool parse_normals(const std::string& text);

/// "#RRGGBB", "white" or "black": sRGB in [0, 1].
Vec3f parse_colour(std::string_view text);

/// Above 0, at most 1.
float parse_opacity(std::string_view text);

/// "u8" or "uint8", ….
ScalarType parse_type(std::string_view text);

/// "little" or "big".
ByteOrder parse_byte_order(std::string_view text);

/// The compression of bricks.
struct Compression {
  BrickCodec codec = BrickCodec::zstd;
  int zstd_level = 3;
  double packed_factor = kMaxPackedFactor;  ///< of automatic
};

/// "none", "packed", "zstd", "zstd:LEVEL", "auto" or "auto:FACTOR".
Compression parse_codec(std::string_view text);

/// "auto" (nothing) or a number of levels.
std::optional<int> parse_levels(std::string_view text);

/// "mean", "max", "min", "mode" or "stride".
Downsampling parse_downsampling_name(std::string_view text);

/// A region as it was typed: what is left out reaches to the border.
using RoiText = RegionRequest;

/// "X0:X1,Y0:Y1,Z0:Z1", half-open; any number, or a whole part, may be left out.
RoiText parse_roi(std::string_view text);

}  // namespace isobrick::tools
