#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>

#include "bricks/storage/range_cache.h"

namespace isobrick::inline v0 {

/// The bytes of one state of a remote object that are kept on the disk: ranges, each a file with
/// checksums of its blocks. Thread-safe. No function throws.
class CachedObject {
 public:
  /// `root_url` names the metadata of its store; "": not known.
  CachedObject(std::shared_ptr<RangeCache> cache, const std::string& url, const ObjectState& state,
               const std::string& root_url = {});

  /// How many bytes from `offset` on are not kept: 0 where that byte is, `size` at most.
  std::uint64_t missing(std::uint64_t offset, std::uint64_t size) const;
  /// Whether all these bytes are kept.
  bool has(std::uint64_t offset, std::uint64_t size) const;
  /// Fills the beginning of `out` with bytes from `offset` on. Returns how many: 0 where none are
  /// kept, or they are damaged, or another process has removed them.
  std::size_t read(std::uint64_t offset, std::span<std::byte> out) const;
  /// Keeps these bytes.
  void write(std::uint64_t offset, std::span<const std::byte> bytes) const;
  /// The object is in another state now, and so may others of its store be: the server is to be
  /// asked again for all of them.
  void forget() const;

 private:
  /// Bytes up to `end` are in the file of a range.
  struct Piece {
    std::uint64_t end;
    std::uint64_t file_offset, file_size;  ///< the range, which its file is named by
    bool is_used;                          ///< since this object was opened
  };
  /// By their first byte. None overlaps another.
  using Pieces = std::map<std::uint64_t, Piece>;

  Pieces::iterator find(std::uint64_t offset) const;
  Pieces::iterator find_behind(std::uint64_t offset) const;
  void list() const;
  void add(std::uint64_t offset, std::uint64_t size, bool is_used) const;
  void remove(std::uint64_t file_offset, std::uint64_t file_size) const;
  std::filesystem::path file_of(std::uint64_t offset, std::uint64_t size) const;

  std::shared_ptr<RangeCache> cache_;
  std::filesystem::path folder_, root_folder_;
  std::string prefix_;  ///< of the names of files of this state
  mutable std::mutex mutex_;
  mutable bool is_listed_ = false;
  mutable Pieces pieces_;
};

}  // namespace isobrick
