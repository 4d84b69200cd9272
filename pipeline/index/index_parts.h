#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <isobrick/index_build.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_chunk.h"

namespace isobrick::inline v0 {

/// Bricks of a level that follow each other in C order.
struct BrickRun {
  std::uint64_t begin = 0, end = 0;
  bool empty() const { return end <= begin; }
};

/// How the work on an index is divided: the bricks of all levels, which ranges are computed of, and
/// with leaves below 16 the chunks of the index. Follows from the store's metadata, the index and
/// the number of parts alone. The parts leave files in a folder beside the store.
class IndexParts {
 public:
  /// The store is a folder on this machine. `count` parts.
  IndexParts(const StoreReader& store, const IndexOptions& options, std::uint32_t count);

  struct Chunk {
    int level = 0;
    Int3 chunk;
  };

  std::uint32_t count() const { return count_; }
  /// What part `number` computes ranges of.
  BrickRun bricks(int level, std::uint32_t number) const;
  /// The smallest box that holds these bricks, which are some.
  Box3 bounds(int level, BrickRun run) const;
  /// The same as boxes, each in one layer, in C order.
  std::vector<Box3> boxes(int level, std::uint32_t number) const;
  /// The chunks that part `number` makes.
  std::vector<Chunk> chunks(std::uint32_t number) const;

  /// Where all parts leave what they make.
  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path folder_of(std::uint32_t number) const;
  std::filesystem::path ranges_file(std::uint32_t number) const;
  std::filesystem::path chunk_file(std::uint32_t number, const Chunk& chunk) const;

  // What files of parts are recognised by: the image, the index, and size and time of the last
  // change of all files of samples that they are made of.
  std::uint32_t ranges_state(std::uint32_t number) const;
  IndexChunkName name_of(const Chunk& chunk) const;

  /// Whether there is something that remove() removes, of parts of this kind of index.
  bool has_rest() const;
  /// Removes the files of all parts, and the folders that are empty then.
  void remove() const;

 private:
  std::uint32_t add_files(int level, Box3 bricks, std::uint32_t crc) const;

  const StoreReader& store_;
  std::uint32_t count_, key_ = 0;
  std::filesystem::path root_, folder_;
  std::vector<Chunk> chunks_;
  std::vector<std::size_t> begins_;  ///< the first chunk of each part, and the number of chunks
};

}  // namespace isobrick
