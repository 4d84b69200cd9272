#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace isobrick::inline v0 {

/// A step of a Zarr codec chain that turns bytes into bytes. Our stores have the
/// first two; the others are read from images of other programs.
enum class ByteCodec : std::uint8_t { zstd, crc32c, gzip, zlib, lz4, blosc };

/// "zstd", "gzip", …
std::string_view name_of(ByteCodec codec);

/// Whether this program was built with what decompresses it.
bool can_decompress(ByteCodec codec);

/// Decompresses into `out` and returns the bytes it took. Throws DamageError for
/// what is broken or does not fit, saying what is wrong, not where; Error when
/// can_decompress() is false. Thread-safe. Not for checksums.
std::size_t decompress(ByteCodec codec, std::span<const std::byte> encoded,
                       std::span<std::byte> out);

}  // namespace isobrick
