#include <isobrick/store_reader.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <tuple>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/lru_cache.h"
#include "bricks/ranges/range_array.h"
#include "bricks/ranges/stored_ranges.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/level_description.h"
#include "bricks/zarr/metadata_files.h"
#include "bricks/zarr/shard_grid.h"
#include "bricks/zarr/shard_index.h"
#include "bricks/zarr/volume_choice.h"
#include "core/shell_word.h"

namespace isobrick::inline v0 {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kMaxOpenObjects = 128;

// No encoder makes a brick much larger than it is; a length beyond is damage,
// and must not make the reader allocate that much memory.
std::uint64_t largest_encoded(std::uint64_t decoded) { return decoded + decoded / 8 + (64 << 10); }

/// Of a whole brick that is not the one which belongs to its place, the end of a message.
std::string why_other_content(const StoreInfo& info) {
  if (info.ours) return "it belongs to another place or store; see: isobrick verify";
  return fmt::format(
      "it belongs to another place, or was changed since the ranges were computed; compute them "
      "anew with: {} --force",
      index_command(info));
}

}  // namespace

std::uint64_t decode_extra(const StoreInfo& info, int threads) {
  std::uint64_t most = 0;
  for (const LevelInfo& level : info.levels) most = std::max(most, level.decode_extra);
  return most * static_cast<std::uint64_t>(threads);
}

struct StoreReader::Impl {
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
  void widen_brick(int level, Int3 b, const Place& place, const std::byte* stored,
                   std::byte* out) const;
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
  std::uint32_t read(int level, Int3 b, const Place& place, std::byte* out);
  std::size_t read_packed(int level, Int3 b, const Place& place, std::span<std::byte> out);
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
  StoreInfo info;
  VolumeChoice volume_choice;
  std::vector<Level> levels;
  std::atomic<std::uint64_t> bytes_read = 0;
  std::atomic<std::uint64_t> brick_bytes_read = 0, brick_bytes_decoded = 0;
  std::atomic<Clock::rep> read_ticks = 0, decode_ticks = 0;
  LruCache<StoredObject> objects{kMaxOpenObjects};  // null: there is none
  LruCache<ShardIndex> indices{kIndexCacheBytes};
};

void StoreReader::Impl::open(const Selection& selection) {
  info.name = storage->name();
  info.selection = selection;
  MetadataFiles metadata = read_metadata_files(*storage);
  const ImageMetadata& image = metadata.image;
  info.ours = image.ours;
  info.metadata_crc32c = metadata.crc32c;
  volume_choice = choose_volume(info.name, image, metadata.levels.front().array, selection);
  info.additions = volume_choice.folder;
  for (std::size_t i = 0; i < image.levels.size(); ++i)
    open_level(image.levels[i], std::move(metadata.levels[i]));
  std::optional<bool> may_have_nan = image.may_have_nan;
  if (const std::optional<StoredRanges> ranges = find_ranges()) {
    if (!image.ours) may_have_nan = ranges->may_have_nan;
    hint_ranges();
    for (std::size_t i = 0; i < levels.size(); ++i)
      open_ranges(static_cast<int>(i), ranges->levels[i]);
  }
  info.type = info.levels[0].lattice.type;
  info.grid_class = image.grid_class;
  info.grid_name = image.grid_name;
  info.labels = image.labels;
  info.fill_value = levels[0].metadata.fill_value;
  info.codec = levels[0].metadata.codecs.name();
  info.may_have_nan = is_floating(info.type) && may_have_nan.value_or(true);
}

// The ranges of the image as it is now: if its metadata was changed since, they are of another.
std::optional<StoredRanges> StoreReader::Impl::find_ranges() const {
  std::optional<StoredRanges> stored = read_stored_ranges(*storage, info.additions);
  if (!stored) return std::nullopt;
  if (stored->image_crc32c == info.metadata_crc32c && stored->levels.size() == levels.size())
    return stored;
  if (info.ours)
    throw DamageError(fmt::format("{}: these are the ranges of another store",
                                  quoted(*storage, ranges_file(info.additions))));
  return std::nullopt;
}

/// Where requests take long, those of all arrays overlap.
void StoreReader::Impl::hint_ranges() const {
  for (int level = 0; level < static_cast<int>(levels.size()); ++level)
    for (const auto folder : {brick_range_folder, block_range_folder, brick_checksum_folder})
      ItemArrayReader::will_open(*storage, folder(info.additions, level));
}

// Ranges of other extents than the level's show a shape that cannot be right
// before anybody walks over it.
void StoreReader::Impl::open_ranges(int level, const RangeChecksums& checksums) {
  const Lattice& samples = lattice(level);
  const auto open = [&](const std::string& folder, Int3 items, std::uint32_t crc32c) {
    using Ranges = std::shared_ptr<const RangeArrayReader>;
    auto ranges =
        std::make_shared<const RangeArrayReader>(storage, folder, items, samples.type, crc32c);
    return ranges->exists() ? Ranges(std::move(ranges)) : Ranges();
  };
  Level& l = levels[static_cast<std::size_t>(level)];
  l.brick_ranges =
      open(brick_range_folder(info.additions, level), samples.bricks(), checksums.bricks);
  l.block_ranges =
      open(block_range_folder(info.additions, level), samples.blocks(), checksums.blocks);
  // Those that are missing are damage: else nobody would notice bricks of another place.
  l.checksums = std::make_shared<const BrickChecksums>(
      storage, brick_checksum_folder(info.additions, level), samples.bricks(), checksums.content);
  info.levels[static_cast<std::size_t>(level)].block_ranges_crc32c = checksums.blocks;
}

void StoreReader::Impl::open_level(const ImageMetadata::Level& described,
                                   MetadataFiles::Level&& read) {
  Level level;
  level.folder = std::move(read.folder);
  level.metadata = std::move(read.array);
  const std::string where = quoted(*storage, read.file);
  level.place = place_volume(level.metadata, volume_choice.place, where);
  info.levels.push_back(describe_level(level.metadata, level.place, described.transform, where));
  level.grid = ShardGrid(info.levels.back());
  if (!levels.empty()) {
    const ArrayMetadata &array = level.metadata, &finest = levels[0].metadata;
    if (array.type != finest.type ||
        fill_bits(array.type, array.fill_value) != fill_bits(finest.type, finest.fill_value))
      throw Error(where + ": levels of different types or fill values are not supported");
  }
  levels.push_back(std::move(level));
}

void StoreReader::Impl::check_level(int level) const {
  if (level < 0 || static_cast<std::size_t>(level) >= levels.size())
    throw UsageError(fmt::format("'{}' has no level {}", info.name, level));
}

void StoreReader::Impl::check_brick(int level, Int3 b) const {
  check_level(level);
  if (!Box3{{0, 0, 0}, lattice(level).bricks()}.contains(b))
    throw UsageError(fmt::format("level {} has no brick ({}, {}, {})", level, b.x, b.y, b.z));
}

void StoreReader::Impl::damaged(int level, Int3 b, const Place& place,
                                const std::string& what) const {
  throw DamageError(fmt::format("level {}, brick ({}, {}, {}): '{}' at {} + {}: {}", level, b.x,
                                b.y, b.z, place.object->name(), place.offset, place.size, what));
}

void StoreReader::Impl::widen_brick(int level, Int3 b, const Place& place, const std::byte* stored,
                                    std::byte* out) const {
  try {
    widen(*at(level).metadata.wide, stored, out,
          static_cast<std::size_t>(volume(lattice(level).brick)));
  } catch (const Error& e) {
    throw Error(fmt::format("level {}, brick ({}, {}, {}): '{}': {}", level, b.x, b.y, b.z,
                            place.object->name(), e.what()));
  }
}

/// The shard of a brick, or its chunk where there are no shards.
Int3 StoreReader::Impl::shard_of(int level, Int3 b) const {
  return at(level).metadata.sharding ? at(level).grid.shard_of(b) : b;
}

std::string StoreReader::Impl::shard_key(int level, Int3 s) const {
  std::vector<Index> coordinates = at(level).place.chunk;
  coordinates.insert(coordinates.end(), {s.z, s.y, s.x});
  return join_key(at(level).folder, at(level).metadata.chunk_key(coordinates));
}

void StoreReader::Impl::missing_shard(int level, Int3 s, const char* why) const {
  throw DamageError(fmt::format("level {}, shard ({}, {}, {}): {} is missing, {}", level, s.x, s.y,
                                s.z, quoted(*storage, shard_key(level, s)), why));
}

std::shared_ptr<const StoredObject> StoreReader::Impl::shard_object(int level, Int3 s) {
  return objects.get(shard_number(level, s), [&] {
    return std::pair(storage->open(shard_key(level, s)), std::uint64_t{1});
  });
}

/// Bytes of a shard's index and where they begin in a shard of so many bytes.
std::pair<std::uint64_t, std::uint64_t> StoreReader::Impl::index_place(int level,
                                                                       std::uint64_t size) const {
  const ArrayMetadata::Sharding& sharding = *at(level).metadata.sharding;
  const std::uint64_t bricks = at(level).grid.shard_bricks() * at(level).place.shard_volumes;
  const std::uint64_t bytes = ShardIndex::encoded_size(bricks, sharding.index_has_crc);
  return {bytes, sharding.index_at_end && size > bytes ? size - bytes : 0};
}

/// Hints that the shards of bricks are opened soon, and then that their indices are read.
void StoreReader::Impl::hint_shards(int level, std::span<const Int3> bricks) {
  std::vector<Int3> shards;
  for (const Int3 b : bricks) shards.push_back(shard_of(level, b));
  const auto order = [](Int3 a, Int3 b) {
    return std::tuple(a.z, a.y, a.x) < std::tuple(b.z, b.y, b.x);
  };
  std::sort(shards.begin(), shards.end(), order);
  shards.erase(std::unique(shards.begin(), shards.end()), shards.end());
  for (const Int3 s : shards) storage->will_open(shard_key(level, s));
  if (!at(level).metadata.sharding) return;
  for (const Int3 s : shards)
    if (const auto object = shard_object(level, s)) {
      const auto [bytes, begin] = index_place(level, object->size());
      object->will_need(begin, bytes);
    }
}

std::shared_ptr<const ShardIndex> StoreReader::Impl::shard_index(int level, Int3 s) {
  return indices.get(shard_number(level, s), [&] {
    const std::uint64_t bricks = at(level).grid.shard_bricks() * at(level).place.shard_volumes;
    const auto object = shard_object(level, s);
    // A shard without an object has only absent bricks.
    if (!object) return std::pair(std::make_shared<const ShardIndex>(0), index_weight(0));
    const ArrayMetadata::Sharding& sharding = *at(level).metadata.sharding;
    const std::uint64_t size = object->size();
    const auto [index_size, begin] = index_place(level, size);
    try {
      if (size < index_size)
        throw DamageError(
            fmt::format("{} bytes are too few for the index of {} bricks", size, bricks));
      std::vector<std::byte> bytes(index_size);
      object->read(begin, bytes);
      bytes_read += index_size;
      return std::pair(std::make_shared<const ShardIndex>(
                           ShardIndex::decode(bytes, sharding.index_has_crc, size)),
                       index_weight(bricks));
    } catch (const DamageError& e) {
      throw DamageError(fmt::format("level {}, shard ({}, {}, {}): '{}': {}", level, s.x, s.y, s.z,
                                    object->name(), e.what()));
    }
  });
}

std::optional<StoreReader::Impl::Place> StoreReader::Impl::find_unchecked(int level, Int3 b) {
  check_brick(level, b);
  if (!at(level).metadata.sharding) {
    auto object = shard_object(level, b);
    if (!object) return std::nullopt;
    const std::uint64_t size = object->size();
    return Place{std::move(object), 0, size};
  }
  const ShardGrid& grid = at(level).grid;
  const Int3 s = grid.shard_of(b);
  const auto index = shard_index(level, s);
  if (index->size() == 0) return std::nullopt;
  const ShardIndex::Entry entry =
      (*index)[at(level).place.in_shard * grid.shard_bricks() + grid.place_in_shard(b)];
  if (entry.absent()) return std::nullopt;
  auto object = shard_object(level, s);
  // The index stays in its cache when the object was closed and opened again.
  if (!object)
    missing_shard(level, s, "but was there when its index was read; open the store anew");
  return Place{std::move(object), entry.offset, entry.size};
}

// To Zarr a shard without an object holds nothing but fill values, so that a lost
// file would pass for empty space. The checksums know better.
std::optional<StoreReader::Impl::Place> StoreReader::Impl::find(int level, Int3 b) {
  const std::optional<Place> place = find_unchecked(level, b);
  const auto& checksums = at(level).checksums;
  if (place || !checksums || checksums->at(b, bytes_read) == kAbsentBrick) return place;
  const Int3 s = shard_of(level, b);
  if (!shard_object(level, s)) missing_shard(level, s, "but has bricks");
  throw DamageError(fmt::format("level {}, brick ({}, {}, {}): {} lacks it: {}", level, b.x, b.y,
                                b.z, quoted(*storage, shard_key(level, s)),
                                why_other_content(info)));
}

void StoreReader::Impl::check_content(int level, Int3 b, const Place& place,
                                      std::uint32_t checksum) {
  const auto& checksums = at(level).checksums;
  if (!checksums) return;
  const std::uint32_t stored = checksums->at(b, bytes_read);
  if (stored != checksum)
    damaged(level, b, place,
            fmt::format("its checksum is {:08x}, that of the brick that belongs here {:08x}: {}",
                        checksum, stored, why_other_content(info)));
}

RangeTable StoreReader::Impl::ranges(int level, Box3 box, bool blocks) {
  check_level(level);
  const auto& reader = blocks ? at(level).block_ranges : at(level).brick_ranges;
  if (!reader)
    throw Error(fmt::format("level {} of '{}' has no ranges yet; run: {}", level, info.name,
                            index_command(info)));
  return reader->read(box, bytes_read);
}

std::string index_command(const StoreInfo& info) {
  const bool is_zip = info.name.ends_with(".zip");  // which cannot be changed
  std::string command =
      is_zip ? fmt::format("unpack {} to FOLDER, then isobrick index FOLDER", shell_word(info.name))
             : "isobrick index " + shell_word(info.name);
  if (info.selection.channel) command += fmt::format(" --channel {}", *info.selection.channel);
  if (info.selection.time) command += fmt::format(" --time {}", *info.selection.time);
  return command;
}

StoreReader::StoreReader(const std::filesystem::path& path, const Selection& selection)
    : StoreReader(open_storage(path), selection) {}

StoreReader::StoreReader(std::shared_ptr<const Storage> storage, const Selection& selection)
    : impl_(std::make_unique<Impl>()) {
  impl_->storage = std::move(storage);
  impl_->open(selection);
}

StoreReader::~StoreReader() = default;

const StoreInfo& StoreReader::info() const { return impl_->info; }

const std::shared_ptr<const Storage>& StoreReader::storage() const { return impl_->storage; }

std::optional<BrickLocation> StoreReader::locate(int level, Int3 b) const {
  const auto place = impl_->find(level, b);
  if (!place) return std::nullopt;
  return BrickLocation{impl_->shard_key(level, impl_->shard_of(level, b)), place->offset,
                       place->size};
}

bool StoreReader::read_brick(int level, Int3 b, std::byte* out) const {
  const auto place = impl_->find(level, b);
  if (!place) return false;
  impl_->check_content(level, b, *place, impl_->read(level, b, *place, out));
  return true;
}

bool StoreReader::is_packed(int level) const { return impl_->at(level).metadata.codecs.packed; }

std::optional<std::size_t> StoreReader::read_packed(int level, Int3 b,
                                                    std::span<std::byte> out) const {
  const auto place = impl_->find(level, b);
  if (!place) return std::nullopt;
  return impl_->read_packed(level, b, *place, out);
}

std::optional<std::uint32_t> StoreReader::read_brick_unchecked(int level, Int3 b,
                                                               std::byte* out) const {
  const auto place = impl_->find_unchecked(level, b);
  if (!place) return std::nullopt;
  return impl_->read(level, b, *place, out);
}

std::size_t StoreReader::Impl::read_packed(int level, Int3 b, const Place& place,
                                           std::span<std::byte> out) {
  if (place.size > out.size())
    damaged(level, b, place, fmt::format("too long for {} bytes", out.size()));
  const std::span encoded = out.first(static_cast<std::size_t>(place.size));
  const auto start = Clock::now();
  place.object->read(place.offset, encoded);
  const auto end_of_read = Clock::now();
  bytes_read += place.size;
  brick_bytes_read += place.size;
  read_ticks += (end_of_read - start).count();
  std::size_t bytes = 0;
  try {
    bytes = without_checksum(encoded).size();
  } catch (const DamageError& e) {
    damaged(level, b, place, e.what());
  }
  decode_ticks += (Clock::now() - end_of_read).count();
  check_content(level, b, place, brick_checksum(at(level).metadata.codecs, encoded));
  return bytes;
}

/// The checksum of the brick that is read.
std::uint32_t StoreReader::Impl::read(int level, Int3 b, const Place& place, std::byte* out) {
  const VolumePlace& volumes = at(level).place;
  const ArrayMetadata& array = at(level).metadata;
  const auto samples = static_cast<std::size_t>(volume(lattice(level).brick));
  const std::size_t stored = samples * array.stored_bytes(),
                    decoded = stored * volumes.chunk_volumes;
  if (place.size > largest_encoded(decoded))
    damaged(level, b, place, fmt::format("too long for {} bytes of samples", decoded));
  thread_local PodBuffer<std::byte> buffer;
  thread_local std::vector<std::byte> several;
  buffer.clear();
  buffer.resize(static_cast<std::size_t>(place.size));
  const std::span encoded(buffer.data(), buffer.size());
  if (volumes.chunk_volumes > 1) several.resize(decoded);
  // What is widened afterwards goes to the end of where its samples will be.
  std::byte* const at_end = out + (lattice(level).brick_bytes() - stored);
  const std::span to = volumes.chunk_volumes > 1 ? std::span(several) : std::span(at_end, stored);
  try {
    const auto start = Clock::now();
    place.object->read(place.offset, encoded);
    const auto end_of_read = Clock::now();
    bytes_read += place.size;
    brick_bytes_read += place.size;
    read_ticks += (end_of_read - start).count();
    decode_brick(array.codecs, lattice(level), array.stored_bytes(), encoded, to);
    brick_bytes_decoded += decoded;
    decode_ticks += (Clock::now() - end_of_read).count();
  } catch (const DamageError& e) {
    damaged(level, b, place, e.what());
  }
  const std::byte* from =
      volumes.chunk_volumes > 1 ? several.data() + volumes.in_chunk * stored : at_end;
  if (array.wide)
    widen_brick(level, b, place, from, out);
  else if (from != out)
    std::copy_n(from, stored, out);
  return brick_checksum(array.codecs, encoded);
}

void StoreReader::will_need(int level, Int3 b) const {
  if (const auto place = impl_->find(level, b))
    place->object->will_need(place->offset, place->size);
}

void StoreReader::will_need(int level, std::span<const Int3> bricks) const {
  if (impl_->storage->is_remote()) impl_->hint_shards(level, bricks);
  for (const Int3 b : bricks) will_need(level, b);
}

bool StoreReader::reads_memory() const {
  // What was fetched ahead over a network comes from memory because of the hints.
  return !impl_->storage->is_remote() && brick_times().from_memory();
}

std::uint64_t StoreReader::bytes_read() const { return impl_->bytes_read; }

BrickTimes StoreReader::brick_times() const {
  const auto seconds = [](Clock::rep ticks) {
    return std::chrono::duration<double>(Clock::duration(ticks)).count();
  };
  return {seconds(impl_->read_ticks), seconds(impl_->decode_ticks), impl_->brick_bytes_read,
          impl_->brick_bytes_decoded};
}

bool StoreReader::has_ranges(int level) const {
  impl_->check_level(level);
  const Impl::Level& l = impl_->at(level);
  return l.brick_ranges && l.block_ranges && l.checksums->exists();
}

RangeTable StoreReader::brick_ranges(int level, Box3 box) const {
  return impl_->ranges(level, box, false);
}

RangeTable StoreReader::block_ranges(int level, Box3 box) const {
  return impl_->ranges(level, box, true);
}

}  // namespace isobrick
