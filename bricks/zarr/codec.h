#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <isobrick/brick_codec.h>
#include <isobrick/lattice.h>
#include <isobrick/sample_value.h>
#include "bricks/zarr/decompress.h"
#include "core/copy_box.h"

namespace isobrick::inline v0 {

/// How the samples of a chunk become bytes: as they are, little or big endian, or packed; then
/// the steps in the order of encoding.
struct CodecChain {
  bool big_endian = false;
  bool packed = false;  ///< see packed/packed_brick.h; then there is no endian
  std::vector<ByteCodec> steps;
  int zstd_level = 0;  ///< of the zstd step, if there is one
  /// Whether what we write has a checksum within the zstd frame; what is read has it or not.
  bool zstd_checksum = false;

  friend bool operator==(const CodecChain&, const CodecChain&) = default;

  /// What we write: bytes → zstd → crc32c, or bytes → crc32c.
  static CodecChain ours(std::optional<int> zstd_level);
  /// The same for Zarr version 2, which has no crc32c: zstd with its own checksum, or nothing.
  static CodecChain ours_v2(std::optional<int> zstd_level);
  /// One of these; packed: samples packed → crc32c.
  static CodecChain of(BrickCodec codec, int zstd_level, bool zarr_v2);
  /// "zstd:3", "packed", "blosc" or "none": how StoreInfo names a chain.
  std::string name() const;
};

/// CRC-32C (Castagnoli) as Zarr stores it. `before` is that of the bytes before these.
std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t before = 0);

/// What lies before the CRC-32C at the end. Throws DamageError where that is another.
std::span<const std::byte> without_checksum(std::span<const std::byte> encoded);

/// A decoded chunk may not be larger than this; larger ones are refused, so that
/// broken metadata cannot take all the memory.
inline constexpr std::uint64_t kMaxBrickBytes = std::uint64_t{1} << 31;

/// The bytes of the fill value as a sample of `type`, native order; the first
/// size_of(type) of the eight count. A NaN becomes the canonical quiet one.
std::uint64_t fill_bits(ScalarType type, const SampleValue& fill_value);

/// True when every sample equals the fill value, bit for bit.
bool all_fill(ScalarType type, std::span<const std::byte> samples, const SampleValue& fill_value);

/// Sets the samples of `part`, which lies in the box, to the fill value.
void fill_box(ScalarType type, const SampleValue& fill_value, BoxSamples<std::byte> samples,
              Box3 part);

/// Sets them to a sample of `bits`, as fill_bits() returns them.
void set_box(ScalarType type, std::uint64_t bits, BoxSamples<std::byte> samples, Box3 part);

/// Sets the samples of brick `b` that lie outside the volume to the fill value:
/// what bricks at the border are padded with before they are encoded.
void pad_brick(const Lattice& lattice, Int3 b, const SampleValue& fill_value, std::byte* brick);

/// Encodes a full brick (native byte order, already padded) as our stores keep
/// it; nothing when all samples equal the fill value. Thread-safe.
std::optional<std::vector<std::byte>> encode_brick(const Lattice& lattice,
                                                   std::span<const std::byte> samples,
                                                   const SampleValue& fill_value,
                                                   const CodecChain& chain);

/// Bytes that one thread keeps to encode bricks of so many bytes.
std::size_t encoder_memory(const CodecChain& chain, std::size_t brick_bytes);

/// Encodes bytes by a chain of our own making that does not pack. Thread-safe.
std::vector<std::byte> encode_bytes(const CodecChain& chain, std::span<const std::byte> bytes);

/// The bytes that `encoded` decodes to, as it states itself; for chains of our own
/// making. Throws DamageError when it does not. Nothing else is checked.
std::uint64_t decoded_size(const CodecChain& chain, std::span<const std::byte> encoded);

/// Decodes a full brick into exactly `out`, native byte order. Bricks that are not packed may have
/// samples of another size, `sample_bytes` as stored, and hold several volumes. Throws DamageError
/// saying what is wrong, not where. Thread-safe.
void decode_brick(const CodecChain& chain, const Lattice& lattice, std::size_t sample_bytes,
                  std::span<const std::byte> encoded, std::span<std::byte> out);

/// The same for bytes that are not packed.
void decode_bytes(const CodecChain& chain, std::size_t sample_bytes,
                  std::span<const std::byte> encoded, std::span<std::byte> out);

}  // namespace isobrick
