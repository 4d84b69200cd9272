#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <isobrick/pod_buffer.h>

namespace isobrick::inline v0 {

/// The filters of HDF5 that are undone here, without libhdf5 and on any thread.
enum class Hdf5Filter : std::uint8_t { deflate, lzf, shuffle, fletcher32 };

/// How the samples of a chunk became bytes.
struct Hdf5Encoding {
  std::vector<Hdf5Filter> filters;  ///< in the order of writing; one at most compresses
  std::size_t element = 1;          ///< bytes of what shuffle takes apart
  std::size_t chunk_bytes = 0;      ///< of a chunk's samples, at most kMaxHdf5Chunk

  /// No chunk has more bytes in a file.
  std::size_t max_packed() const;
};

inline constexpr std::size_t kMaxHdf5Chunk = std::size_t{1} << 31;

/// A chunk's bytes, and room for another form of them.
struct Hdf5ChunkBuffers {
  PodBuffer<std::byte> bytes, other;
};

/// Turns `bytes` from what is in the file into the chunk's samples. Bit i of
/// `skipped` is set where filter i was not applied. Throws DamageError saying what is wrong,
/// not where. Thread-safe.
void undo_filters(const Hdf5Encoding& encoding, std::uint32_t skipped, Hdf5ChunkBuffers& buffers);

}  // namespace isobrick
