#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Encodes `width` × `height` pixels, rows from the top, 3 bytes (sRGB) each, as a PNG file. Throws
/// Error, which names the picture `name`, for another number of bytes.
std::vector<std::byte> encode_png(const std::string& name, int width, int height,
                                  std::span<const std::uint8_t> rgb);

/// Writes `width` × `height` pixels, rows from the top, 3 bytes (sRGB) each, to
/// `out` and publishes it.
void write_png(OutputFile& out, int width, int height, std::span<const std::uint8_t> rgb);

/// The same to a file of its own; see OutputFile for what `path` and `force` may throw.
void write_png(const std::string& path, int width, int height, std::span<const std::uint8_t> rgb,
               bool force);

}  // namespace isobrick
