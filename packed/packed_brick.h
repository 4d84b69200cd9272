#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Packs a brick of `extent` samples, C order [z, y, x] in native byte order, without loss. The
/// bytes are the same on every processor; docs/reference/packed_codec.md specifies them.
/// Thread-safe.
std::vector<std::byte> pack_brick(ScalarType type, Int3 extent, std::span<const std::byte> samples);

/// Bytes that one thread keeps to pack or unpack bricks of so many bytes.
std::size_t packed_brick_memory(std::size_t brick_bytes);

/// Unpacks into exactly the samples of a brick. Throws DamageError saying what is wrong, not where;
/// `samples` is undefined then. Thread-safe.
void unpack_brick(ScalarType type, Int3 extent, std::span<const std::byte> packed,
                  std::span<std::byte> samples);

}  // namespace isobrick
