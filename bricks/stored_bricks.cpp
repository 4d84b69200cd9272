#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <tuple>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/store_reader_impl.h"
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

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

void StoreReader::Impl::widen_brick(int level, const std::byte* stored, std::byte* out) const {
  widen(*at(level).metadata.wide, stored, out,
        static_cast<std::size_t>(volume(lattice(level).brick)));
}

void StoreReader::Impl::make_surface_brick(int level, Int3 b, const Place& place,
                                           std::byte* out) const {
  try {
    make_surface_samples(lattice(level).type, out,
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

/// When the bytes of a brick are here.
StoreReader::Impl::Clock::time_point StoreReader::Impl::read_encoded(const Place& place,
                                                                     std::span<std::byte> to) {
  const auto start = Clock::now();
  place.object->read(place.offset, to);
  const auto end = Clock::now();
  bytes_read += place.size;
  brick_bytes_read += place.size;
  read_ticks += (end - start).count();
  return end;
}

std::size_t StoreReader::Impl::read_packed(int level, Int3 b, const Place& place,
                                           std::span<std::byte> out) {
  if (place.size > out.size())
    damaged(level, b, place, fmt::format("too long for {} bytes", out.size()));
  const std::span encoded = out.first(static_cast<std::size_t>(place.size));
  const auto end_of_read = read_encoded(place, encoded);
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
std::uint32_t StoreReader::Impl::read(int level, Int3 b, const Place& place, bool is_native,
                                      std::byte* out) {
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
    const auto end_of_read = read_encoded(place, encoded);
    decode_brick(array.codecs, lattice(level), array.stored_bytes(), encoded, to);
    brick_bytes_decoded += decoded;
    decode_ticks += (Clock::now() - end_of_read).count();
  } catch (const DamageError& e) {
    damaged(level, b, place, e.what());
  }
  const std::byte* from =
      volumes.chunk_volumes > 1 ? several.data() + volumes.in_chunk * stored : at_end;
  if (array.wide)
    widen_brick(level, from, out);
  else if (from != out)
    std::copy_n(from, stored, out);
  if (!is_native) make_surface_brick(level, b, place, out);
  return brick_checksum(array.codecs, encoded);
}

}  // namespace isobrick
