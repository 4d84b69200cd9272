#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include <isobrick/lattice.h>
#include "io/bytes/file.h"
#include "io/bytes/output_folder.h"

namespace isobrick::inline v0 {

/// Remembers, beside the unfinished store, what the input looked like: one
/// checksum for each layer of bricks. A resumed conversion reads the input
/// again and finds out here when it is not the one that the finished shards
/// were made of.
class ConvertJournal {
 public:
  /// With `resume` the layers that an earlier run recorded are compared.
  ConvertJournal(const std::filesystem::path& store, const Lattice& lattice, bool resume);

  /// The checksum of one brick's samples; bricks in any order.
  void add(Int3 brick, std::uint32_t crc);
  /// All bricks that lie below z1 were added. Throws Error when they differ
  /// from what is on record.
  void close(Index z1);
  /// The store is whole and has its name: the record goes.
  void remove();

 private:
  void read_earlier();
  void record(Index layer, std::uint64_t sum);

  OutputFolder folder_;
  std::filesystem::path path_;
  Lattice lattice_;
  File file_;
  std::vector<std::uint64_t> earlier_;
  std::map<Index, std::uint64_t> open_;  ///< layers not closed yet
  Index next_ = 0;
};

}  // namespace isobrick
