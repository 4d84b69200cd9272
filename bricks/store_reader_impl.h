#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <isobrick/store_reader.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/lru_cache.h"
#include "bricks/ranges/range_array.h"
#include "bricks/ranges/stored_ranges.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/level_description.h"
#include "bricks/zarr/metadata_files.h"
#include "bricks/zarr/shard_grid.h"
#include "bricks/zarr/shard_index.h"
#include "bricks/zarr/volume_choice.h"

namespace isobrick::inline v0 {

/// Objects of a store that are open at a time.
inline constexpr std::uint64_t kMaxOpenObjects = 128;

/// What a store is, and what of it is open: its metadata are read in store_reader.cpp, its bricks
/// found and read in stored_bricks.cpp.
struct StoreReader::Impl {
  using Clock = std::chrono::steady_clock;
  struct Level {
    ArrayMetadata metadata;
    std::string folder;  // a key
    VolumePlace place;
    ShardGrid grid;
    std::shared_ptr<const RangeArrayReader> brick_ranges, block_ranges;  // null: none
    std::shared_ptr<const BrickChecksums> checksums;                     // null: none
  };
  struct Place {
    std::shared_ptr<const StoredObject> object;
    std::uint64_t offset = 0, size = 0;
  };

  void open(const Selection& selection);
  std::optional<StoredRanges> find_ranges() const;
  void open_level(const ImageMetadata::Level& described, MetadataFiles::Level&& read);
  void hint_ranges() const;
  void open_ranges(int level, const RangeChecksums& checksums);
  void check_level(int level) const;
  void check_brick(int level, Int3 b) const;
  [[noreturn]] void damaged(int level, Int3 b, const Place& place, const std::string& what) const;
  void widen_brick(int level, const std::byte* stored, std::byte* out) const;
  void make_surface_brick(int level, Int3 b, const Place& place, std::byte* out) const;
  Int3 shard_of(int level, Int3 b) const;
  std::string shard_key(int level, Int3 s) const;
  [[noreturn]] void missing_shard(int level, Int3 s, const char* why) const;
  std::shared_ptr<const StoredObject> shard_object(int level, Int3 s);
  std::shared_ptr<const ShardIndex> shard_index(int level, Int3 s);
  std::pair<std::uint64_t, std::uint64_t> index_place(int level, std::uint64_t size) const;
  void hint_shards(int level, std::span<const Int3> bricks);
  std::optional<Place> find_unchecked(int level, Int3 b);
  std::optional<Place> find(int level, Int3 b);
  void check_content(int level, Int3 b, const Place& place, std::uint32_t checksum);
  std::uint32_t read(int level, Int3 b, const Place& place, bool is_native, std::byte* out);
  std::size_t read_packed(int level, Int3 b, const Place& place, std::span<std::byte> out);
  Clock::time_point read_encoded(const Place& place, std::span<std::byte> to);
  RangeTable ranges(int level, Box3 box, bool blocks);
  std::uint64_t shard_number(int level, Int3 s) const {
    return static_cast<std::uint64_t>(linear_index(s, at(level).grid.shards)) * 64 +
           static_cast<std::uint64_t>(level);
  }
  const Level& at(int level) const { return levels[static_cast<std::size_t>(level)]; }
  const Lattice& lattice(int level) const {
    return info.levels[static_cast<std::size_t>(level)].lattice;
  }

  std::shared_ptr<const Storage> storage;
  StoreInfo info;          // of native()
  StoreInfo surface_info;  // with the types that surfaces are made of
  VolumeChoice volume_choice;
  std::vector<Level> levels;
  std::atomic<std::uint64_t> bytes_read = 0;
  std::atomic<std::uint64_t> brick_bytes_read = 0, brick_bytes_decoded = 0;
  std::atomic<Clock::rep> read_ticks = 0, decode_ticks = 0;
  LruCache<StoredObject> objects{kMaxOpenObjects};  // null: there is none
  LruCache<ShardIndex> indices{kIndexCacheBytes};
};

}  // namespace isobrick
