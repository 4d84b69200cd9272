#pragma once

#include <cstddef>
#include <span>

namespace isobrick::inline v0 {

/// The frame of a deflate stream, with its checksum.
enum class Wrapper : unsigned char {
  gzip,  ///< one or more members; what follows them is passed over
  zlib,
};

/// What inflate() has done.
struct InflateResult {
  enum class Status : unsigned char {
    complete,  ///< the stream ended and its checksum is right
    no_room,   ///< the stream goes on behind the end of the output
    cut_off,   ///< the input ends before the stream does
    invalid,   ///< no deflate stream, or a wrong checksum
  };
  Status status = Status::invalid;
  std::size_t size = 0;  ///< bytes written
  int code = 0;          ///< of the library, for messages; 0 when complete

  /// Whether the stream is whole and has filled an output of `expected` bytes.
  bool filled(std::size_t expected) const { return status == Status::complete && size == expected; }
};

/// Nothing that zlib makes of so many bytes is longer.
constexpr std::size_t max_deflated(std::size_t bytes) { return bytes + bytes / 1000 + 64; }

/// Inflates one stream that is in memory as a whole, of gzip the first member. Neither span has
/// 4 GiB or more. Thread-safe.
InflateResult inflate(Wrapper wrapper, std::span<const std::byte> packed, std::span<std::byte> out);

}  // namespace isobrick
