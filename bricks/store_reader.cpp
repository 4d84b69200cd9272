#include <isobrick/store_reader.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include <isobrick/error.h>
#include "bricks/ranges/item_array.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/store_reader_impl.h"
#include "core/shell_word.h"

namespace isobrick::inline v0 {

std::uint64_t decode_extra(const StoreInfo& info, int threads) {
  std::uint64_t most = 0;
  for (const LevelInfo& level : info.levels) most = std::max(most, level.decode_extra);
  return most * static_cast<std::uint64_t>(threads);
}

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
  info.type = info.stored_type = info.levels[0].lattice.type;
  info.grid_class = image.grid_class;
  info.grid_name = image.grid_name;
  info.labels = image.labels;
  info.fill_value = levels[0].metadata.fill_value;
  info.codec = levels[0].metadata.codecs.name();
  info.may_have_nan = is_floating(info.type) && may_have_nan.value_or(true);
  surface_info = info;
  surface_info.type = surface_type(info.type);
  for (LevelInfo& level : surface_info.levels) level.lattice.type = surface_info.type;
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
    : impl_(std::make_shared<Impl>()) {
  impl_->storage = std::move(storage);
  impl_->open(selection);
}

StoreReader::~StoreReader() = default;

StoreReader::StoreReader(std::shared_ptr<Impl> impl, bool is_native)
    : impl_(std::move(impl)), is_native_(is_native) {}

StoreReader StoreReader::native() const { return {impl_, true}; }

const StoreInfo& StoreReader::info() const {
  return is_native_ ? impl_->info : impl_->surface_info;
}

const std::shared_ptr<const Storage>& StoreReader::storage() const { return impl_->storage; }

std::optional<BrickLocation> StoreReader::locate(int level, Int3 b) const {
  const auto place = impl_->find(level, b);
  if (!place) return std::nullopt;
  return BrickLocation{impl_->shard_key(level, impl_->shard_of(level, b)), place->offset,
                       place->size};
}

std::string StoreReader::key_of(int level, Int3 b) const {
  impl_->check_brick(level, b);
  return impl_->shard_key(level, impl_->shard_of(level, b));
}

bool StoreReader::read_brick(int level, Int3 b, std::byte* out) const {
  const auto place = impl_->find(level, b);
  if (!place) return false;
  impl_->check_content(level, b, *place, impl_->read(level, b, *place, is_native_, out));
  return true;
}

bool StoreReader::is_packed(int level) const {
  const ArrayMetadata& array = impl_->at(level).metadata;
  return array.codecs.packed && (is_native_ || !is_wide_integer(array.type));
}

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
  return impl_->read(level, b, *place, is_native_, out);
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
  const auto seconds = [](Impl::Clock::rep ticks) {
    return std::chrono::duration<double>(Impl::Clock::duration(ticks)).count();
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
