#pragma once

#include <tbb/task_arena.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/vec.h>
#include "io/volumes/hdf5/hdf5_filters.h"

namespace isobrick::inline v0 {

/// A chunked array and how its chunks are encoded. Axes are in the order fastest first.
struct Hdf5ChunkLayout {
  std::string path;                 ///< for messages
  std::vector<Index> extent, edge;  ///< samples of the array and of a chunk
  Hdf5Encoding encoding;
  std::size_t sample = 1;           ///< bytes of one
  bool swap = false;                ///< samples are of the other byte order
  std::array<std::byte, 8> fill{};  ///< a sample of chunks that are not there, native byte order
};

/// Copies a chunk's bytes as they are in the file, and returns which of its filters
/// were skipped; nothing where there is no such chunk. `first` is its first sample.
using Hdf5Fetch = std::function<std::optional<std::uint32_t>(const std::vector<Index>& first,
                                                             PodBuffer<std::byte>& bytes)>;

/// Reads boxes of an array chunk by chunk: these are fetched one after the other
/// and decoded on several threads. Chunks that go on behind a box are kept for the
/// next one where a layer of them is not much.
class Hdf5Chunks {
 public:
  /// `threads` 0: all cores.
  Hdf5Chunks(Hdf5ChunkLayout layout, Hdf5Fetch fetch, int threads);

  /// Bytes that reading takes at most, beside the requested samples.
  std::size_t memory() const;

  /// Copies the box whose first sample is `start` and which has `count` samples along
  /// each axis to `out`, C order. One thread at a time. Throws DamageError.
  void read(const std::vector<Index>& start, const std::vector<Index>& count, std::byte* out);

 private:
  struct Box {
    const std::vector<Index>&start, &count;
    std::byte* out;
  };
  /// A chunk on its way.
  struct Item {
    std::vector<Index> first;
    std::optional<std::uint32_t> skipped;
    bool decoded = false;
    Hdf5ChunkBuffers buffers;
  };

  std::size_t layer_bytes() const;
  bool next_chunk(const Box& box, std::vector<Index>& first) const;
  void drop_others(const Box& box);
  void fetch(Item& item);
  void decode(Item& item) const;
  void copy(const Item& item, const Box& box) const;
  void finish(Item& item, const Box& box);

  Hdf5ChunkLayout layout_;
  Hdf5Fetch fetch_;
  tbb::task_arena arena_;
  std::vector<Item> items_;
  std::size_t max_kept_;  ///< chunks

  std::mutex mutex_;
  std::vector<Item*> free_;
  std::map<std::vector<Index>, PodBuffer<std::byte>> kept_;  ///< by first sample, decoded
};

}  // namespace isobrick
