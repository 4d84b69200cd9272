#include "bricks/store_writer.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <atomic>
#include <map>
#include <mutex>

#include <isobrick/error.h>
#include <isobrick/image_metadata.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/range_array.h"
#include "bricks/ranges/stored_ranges.h"
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/publisher.h"
#include "bricks/zarr/shard_grid.h"
#include "bricks/zarr/shard_index.h"
#include "bricks/zarr/store_names.h"
#include "bricks/zarr/zarr_v2.h"
#include "io/bytes/file.h"
#include "io/bytes/folder_walk.h"

namespace isobrick::inline v0 {
namespace {

// Shards being written keep their file open while there are no more than so
// many; those beyond reopen it for each brick.
constexpr int kMaxOpenShards = 256;

// Bytes of a shard after which the disk starts on them.
constexpr std::uint64_t kWriteback = std::uint64_t{8} << 20;

struct OpenShard {
  explicit OpenShard(std::size_t bricks) : index(bricks), checksums(bricks, kAbsentBrick) {}
  std::mutex mutex;
  std::filesystem::path path;
  File file;  // empty when closed between bricks
  bool created = false;
  bool counted = false;  // one of kMaxOpenShards
  std::uint64_t end = 0;
  std::uint64_t writeback_end = 0;  // writing back has begun up to here
  ShardIndex index;
  std::vector<std::uint32_t> checksums;  // of its bricks, in the order of the index
};

}  // namespace

struct StoreWriter::Impl {
  struct Level {
    Lattice lattice;
    ShardGrid grid;
    ArrayMetadata metadata;
    std::filesystem::path folder;
    std::unique_ptr<ItemArrayWriter> brick_ranges, block_ranges, brick_checksums;
  };

  Impl(const std::filesystem::path& directory, const StoreLayout& store_layout, bool is_resume)
      : dir(directory), layout(store_layout), resume(is_resume) {}

  void check_resume();
  void prepare_folder();
  void open_levels();
  Level& level(int i) {
    if (i < 0 || static_cast<std::size_t>(i) >= levels.size())
      throw UsageError(fmt::format("there is no level {}", i));
    return levels[static_cast<std::size_t>(i)];
  }
  std::filesystem::path shard_path(const Level& l, Int3 s) const {
    return l.folder / l.metadata.chunk_key(std::array<Index, 3>{s.z, s.y, s.x});
  }
  std::shared_ptr<OpenShard> open_shard(int i, Int3 s);
  void write(OpenShard& shard, std::span<const std::byte> bytes);
  void publish_root(const ImageMetadata& image);
  void reopen(OpenShard& shard);
  std::optional<ShardIndex> whole_index(const Level& l, const File& file) const;
  void put_checksums(const Level& l, Int3 s, std::span<const std::uint32_t> checksums) const;
  std::optional<RangeChecksums> finish_items(Level& l) const;

  std::filesystem::path dir;
  StoreLayout layout;
  bool resume;
  std::vector<Level> levels;
  std::atomic<int> open_files = 0;
  std::mutex mutex;
  std::map<std::pair<int, Index>, std::shared_ptr<OpenShard>> open_shards;
  std::unique_ptr<Publisher> publisher;
  std::optional<StoredHistogram> histogram;
};

void StoreWriter::Impl::check_resume() {
  const std::filesystem::path marker_path = dir / kLayoutMarker;
  const auto text = read_small_file(marker_path, kMaxMetadataBytes);
  if (!text)
    throw Error(fmt::format("'{}' is no store whose conversion was interrupted", dir.string()));
  check_same_layout(*text, layout, quoted(marker_path), quoted(dir));
}

void StoreWriter::Impl::prepare_folder() {
  std::error_code failure;
  std::filesystem::create_directories(dir, failure);
  if (failure) throw system_error("create directory", dir.string(), failure.value());
  const bool empty = std::filesystem::is_empty(dir, failure);
  if (failure) throw system_error("read directory", dir.string(), failure.value());
  if (!empty && !resume) throw Error(fmt::format("'{}' exists and is not empty", dir.string()));
  publisher = std::make_unique<Publisher>(dir);
  if (!empty) {
    check_resume();
    walk_folder(dir, [&](const std::filesystem::path& path, std::filesystem::file_type type) {
      if (type != std::filesystem::file_type::directory && is_temporary_name(path))
        publisher->folder().remove_file(dir / path);
      return true;
    });
  }
  if (empty) {
    // It has its name before any other file is there. That it is durable is not
    // waited for: what a power failure can take with it was begun a moment ago.
    const std::string text = layout_marker(layout);
    File marker = publisher->write_temporary(dir / kLayoutMarker, std::as_bytes(std::span(text)));
    publisher->folder().rename_file(marker.path(), dir / kLayoutMarker);
    publisher->sync(std::move(marker));
  }
}

void StoreWriter::Impl::open_levels() {
  for (std::size_t i = 0; i < layout.levels.size(); ++i) {
    const LevelInfo& info = layout.levels[i];
    Level& l = levels.emplace_back();
    l.lattice = info.lattice;
    l.grid = ShardGrid(info);
    l.metadata = array_metadata(info, layout);
    l.folder = dir / std::to_string(i);
    const int number = static_cast<int>(i);
    const auto writer = [&](const std::filesystem::path& folder, Int3 items, ArrayMetadata array) {
      return std::make_unique<ItemArrayWriter>(folder, items, std::move(array), *publisher);
    };
    const Int3 bricks = l.lattice.bricks(), blocks = l.lattice.blocks();
    l.brick_ranges = writer(dir / brick_range_folder("", number), bricks,
                            range_array_metadata(bricks, l.lattice.type));
    l.block_ranges = writer(dir / block_range_folder("", number), blocks,
                            range_array_metadata(blocks, l.lattice.type));
    l.brick_checksums =
        writer(dir / brick_checksum_folder("", number), bricks, checksum_array_metadata(bricks));
  }
}

std::shared_ptr<OpenShard> StoreWriter::Impl::open_shard(int i, Int3 s) {
  Level& l = level(i);
  const std::lock_guard lock(mutex);
  const std::pair key(i, linear_index(s, l.grid.shards));
  if (const auto found = open_shards.find(key); found != open_shards.end()) return found->second;
  // Made first: where memory is short, no entry stays without its shard.
  auto shard = std::make_shared<OpenShard>(static_cast<std::size_t>(l.grid.shard_bricks()));
  shard->path = shard_path(l, s);
  open_shards.emplace(key, shard);
  return shard;
}

void StoreWriter::Impl::write(OpenShard& shard, std::span<const std::byte> bytes) {
  if (!shard.created) {
    shard.file = publisher->create_temporary(shard.path);
    shard.created = true;
    shard.counted = ++open_files <= kMaxOpenShards;
    if (!shard.counted) --open_files;
  } else if (!shard.file) {
    reopen(shard);
  }
  shard.file.write_at(shard.end, bytes);
  shard.end += bytes.size();
  if (shard.end - shard.writeback_end >= kWriteback) {
    shard.file.start_writeback(shard.writeback_end, shard.end - shard.writeback_end);
    shard.writeback_end = shard.end;
  }
  publisher->count(bytes.size());
  if (!shard.counted) shard.file = File();
}

void StoreWriter::Impl::reopen(OpenShard& shard) {
  const std::filesystem::path name = temporary_name(shard.path);
  shard.file = publisher->folder().open_file(name, O_RDWR);
  if (!shard.file) throw Error(fmt::format("'{}' has gone while it was written", name.string()));
}

StoreWriter::StoreWriter(const std::filesystem::path& dir, const StoreLayout& layout, bool resume)
    : impl_(std::make_unique<Impl>(dir, layout, resume)) {
  check_layout(layout);
  impl_->prepare_folder();
  impl_->open_levels();
}

StoreWriter::~StoreWriter() {
  for (const auto& [key, shard] : impl_->open_shards)
    if (shard->created) impl_->publisher->discard_temporary(shard->path);
}

/// The index of a shard's file; nothing if the file is not whole.
std::optional<ShardIndex> StoreWriter::Impl::whole_index(const Level& l, const File& file) const {
  const std::uint64_t size = file.size();
  if (!l.metadata.sharding) {  // it has its name only when it is whole
    ShardIndex index(1);
    index[0] = {0, size};
    return index;
  }
  const std::uint64_t index_size = ShardIndex::encoded_size(l.grid.shard_bricks(), true);
  if (size < index_size) return std::nullopt;
  std::vector<std::byte> bytes(index_size);
  file.read_at(size - index_size, bytes);
  try {
    ShardIndex index = ShardIndex::decode(bytes, true, size - index_size);
    // The bricks of our shards leave no gaps, so their sizes sum up to the file's.
    if (index.brick_bytes() == size - index_size) return index;
  } catch (const DamageError&) {
    // As one whose sizes do not add up.
  }
  return std::nullopt;
}

bool StoreWriter::shard_is_whole(int level, Int3 s) const {
  const Impl::Level& l = impl_->level(level);
  if (!impl_->resume) return false;
  const File file = impl_->publisher->folder().open_file(impl_->shard_path(l, s), O_RDONLY);
  return file && impl_->whole_index(l, file);
}

void StoreWriter::keep_shard(int level, Int3 s) {
  const Impl::Level& l = impl_->level(level);
  const std::filesystem::path path = impl_->shard_path(l, s);
  const File file = impl_->publisher->folder().open_file(path, O_RDONLY);
  const auto index = file ? impl_->whole_index(l, file) : std::nullopt;
  if (!index) throw Error(fmt::format("'{}' has changed meanwhile", path.string()));
  std::vector<std::uint32_t> checksums;
  const std::vector<ByteCodec>& steps = l.metadata.codecs.steps;
  const bool ends_with_checksum = !steps.empty() && steps.back() == ByteCodec::crc32c;
  std::vector<std::byte> bytes;
  for (const ShardIndex::Entry& brick : index->entries()) {
    checksums.push_back(kAbsentBrick);
    if (brick.absent()) continue;
    const std::uint64_t needed = ends_with_checksum
                                     ? std::min<std::uint64_t>(brick.size, sizeof(std::uint32_t))
                                     : brick.size;
    bytes.resize(needed);
    file.read_at(brick.offset + brick.size - needed, bytes);
    checksums.back() = brick_checksum(l.metadata.codecs, bytes);
  }
  impl_->put_checksums(l, s, checksums);
}

bool StoreWriter::take_shard(int level, Int3 s, const std::filesystem::path& other) {
  const std::filesystem::path path = impl_->shard_path(impl_->level(level), s);
  const std::filesystem::path from = other / path.lexically_relative(impl_->dir);
  impl_->publisher->folder().make_folder(path.parent_path());
  std::error_code failure;
  std::filesystem::rename(from, path, failure);
  if (failure && failure != std::errc::no_such_file_or_directory)
    throw system_error("move a shard to", path.string(), failure.value());
  const File file = impl_->publisher->folder().open_file(path, O_RDONLY);
  if (!file) return false;
  if (!failure) impl_->publisher->count(file.size());
  return true;
}

void StoreWriter::sync_shards() { impl_->publisher->wait(); }

/// `checksums` of all bricks of a shard, also of those beyond the volume.
void StoreWriter::Impl::put_checksums(const Level& l, Int3 s,
                                      std::span<const std::uint32_t> checksums) const {
  const Int3 n = l.grid.bricks_per_shard;
  const Box3 box = intersect({s * n, (s + Int3{1, 1, 1}) * n}, {{0, 0, 0}, l.lattice.bricks()});
  std::vector<std::uint32_t> inside;
  inside.reserve(static_cast<std::size_t>(volume(box.extent())));
  for_each_point(box, [&](Int3 b) { inside.push_back(checksums[l.grid.place_in_shard(b)]); });
  l.brick_checksums->put(box, std::as_bytes(std::span(inside)));
}

void StoreWriter::forget_shard(int level, Int3 s) {
  if (impl_->resume)
    impl_->publisher->folder().remove_file(impl_->shard_path(impl_->level(level), s));
}

void StoreWriter::finish_below(int level, Index z) {
  impl_->level(level).brick_checksums->fill_below(z);
}

void StoreWriter::put(int level, Int3 brick, std::span<const std::byte> encoded) {
  Impl::Level& l = impl_->level(level);
  if (!Box3{{0, 0, 0}, l.lattice.bricks()}.contains(brick))
    throw UsageError(
        fmt::format("level {} has no brick ({}, {}, {})", level, brick.x, brick.y, brick.z));
  if (encoded.empty()) return;
  const std::size_t i = l.grid.place_in_shard(brick);
  const auto shard = impl_->open_shard(level, l.grid.shard_of(brick));
  const std::lock_guard lock(shard->mutex);
  if (!shard->index[i].absent())
    throw UsageError(fmt::format("brick ({}, {}, {}) of level {} was put twice", brick.x, brick.y,
                                 brick.z, level));
  const std::uint64_t offset = shard->end;
  impl_->write(*shard, encoded);
  shard->index[i] = {offset, encoded.size()};
  shard->checksums[i] = brick_checksum(l.metadata.codecs, encoded);
}

void StoreWriter::finish_shard(int level, Int3 s) {
  Impl::Level& l = impl_->level(level);
  if (!Box3{{0, 0, 0}, l.grid.shards}.contains(s))
    throw UsageError(fmt::format("level {} has no shard ({}, {}, {})", level, s.x, s.y, s.z));
  std::shared_ptr<OpenShard> shard;
  {
    const std::lock_guard lock(impl_->mutex);
    const auto found = impl_->open_shards.find({level, linear_index(s, l.grid.shards)});
    if (found != impl_->open_shards.end()) shard = found->second;
  }
  if (!shard || !shard->created) {
    // All absent: no file. An earlier run may have left a damaged one.
    forget_shard(level, s);
    const std::vector<std::uint32_t> absent(static_cast<std::size_t>(l.grid.shard_bricks()),
                                            kAbsentBrick);
    return impl_->put_checksums(l, s, absent);
  }
  const std::lock_guard lock(shard->mutex);
  if (l.metadata.sharding) impl_->write(*shard, shard->index.encode());
  if (!shard->file) impl_->reopen(*shard);
  if (shard->counted) --impl_->open_files;
  impl_->publisher->publish(std::move(shard->file), shard->path);
  impl_->put_checksums(l, s, shard->checksums);
  const std::lock_guard map_lock(impl_->mutex);
  impl_->open_shards.erase({level, linear_index(s, l.grid.shards)});
}

void StoreWriter::put_brick_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  Impl::Level& l = impl_->level(level);
  std::vector<std::byte> room;
  l.brick_ranges->put(box, stored_pairs(l.lattice.type, pairs, room));
}

void StoreWriter::put_block_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  Impl::Level& l = impl_->level(level);
  std::vector<std::byte> room;
  l.block_ranges->put(box, stored_pairs(l.lattice.type, pairs, room));
}

void StoreWriter::copy_ranges(int level, const StoreReader& store,
                              const RangeChecksums& checksums) {
  Impl::Level& l = impl_->level(level);
  const std::string& additions = store.info().additions;
  const auto copy = [&](const std::string& folder, Int3 items, std::uint32_t crc32c,
                        ItemArrayWriter& to) {
    const ArrayMetadata array = range_array_metadata(items, l.lattice.type);
    ItemArrayReader(store.storage(), folder, items, array, crc32c).copy_to(to);
  };
  copy(brick_range_folder(additions, level), l.lattice.bricks(), checksums.bricks, *l.brick_ranges);
  copy(block_range_folder(additions, level), l.lattice.blocks(), checksums.blocks, *l.block_ranges);
}

void StoreWriter::put_histogram(const SampleCounts& counts) {
  impl_->histogram = write_histogram(impl_->dir / histogram_folder(""), counts, *impl_->publisher);
}

void StoreWriter::Impl::publish_root(const ImageMetadata& image) {
  const RootFile file = root_file(image, layout);
  const std::filesystem::path root = dir / file.name;
  publisher->sync(publisher->write_temporary(root, std::as_bytes(std::span(file.json))));
  publisher->wait();
  publisher->folder().rename_file(temporary_name(root), root);
}

/// Nothing of a level without ranges: it has no checksums either.
std::optional<RangeChecksums> StoreWriter::Impl::finish_items(Level& l) const {
  const auto bricks = l.brick_ranges->finish(), blocks = l.block_ranges->finish();
  if (!bricks || !blocks) return std::nullopt;
  return RangeChecksums{
      .bricks = *bricks, .blocks = *blocks, .content = l.brick_checksums->finish().value_or(0)};
}

void StoreWriter::finish(bool may_have_nan,
                         const std::function<std::optional<DisplayWindow>()>& window,
                         const std::function<void()>& more) {
  Publisher& publisher = *impl_->publisher;
  const StoreLayout& layout = impl_->layout;
  {
    const std::lock_guard lock(impl_->mutex);
    if (!impl_->open_shards.empty())
      throw Error(
          fmt::format("'{}' was not finished", impl_->open_shards.begin()->second->path.string()));
  }
  publisher.write(impl_->dir / "isobrick" / "zarr.json", group_json());
  StoredRanges ranges{
      .may_have_nan = may_have_nan, .image_crc32c = 0, .levels = {}, .histogram = impl_->histogram};
  for (std::size_t i = 0; i < impl_->levels.size(); ++i) {
    Impl::Level& l = impl_->levels[i];
    if (const auto checksums = impl_->finish_items(l)) ranges.levels.push_back(*checksums);
    publisher.write(impl_->dir / "isobrick" / std::to_string(i) / "zarr.json", group_json());
    if (layout.ome == OmeVersion::v04)
      publisher.write(l.folder / ".zarray", to_zarray(l.metadata));
    else
      publisher.write(l.folder / "zarr.json", to_json(l.metadata));
  }
  ImageMetadata image = image_metadata(impl_->layout);
  image.may_have_nan = may_have_nan;
  if (layout.ome == OmeVersion::v04) publisher.write(impl_->dir / ".zgroup", zgroup_json());
  image.checksum =
      layout_checksum(image, layout, quoted(impl_->dir / root_file(image, layout).name));
  ranges.image_crc32c = *image.checksum;
  if (ranges.levels.size() == impl_->levels.size())
    publisher.write(impl_->dir / ranges_file(""), to_json(ranges));
  // Only now, with everything on disk, does the directory become a store.
  impl_->publish_root(image);
  if (window) {
    image.window = window();
    impl_->publish_root(image);
  }
  if (more) more();
  publisher.folder().remove_file(impl_->dir / kLayoutMarker);
  publisher.folder().sync_folder(impl_->dir);
}

std::uint64_t StoreWriter::bytes() const { return impl_->publisher->bytes(); }

}  // namespace isobrick
