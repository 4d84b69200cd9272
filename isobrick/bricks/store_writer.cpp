#include "isobrick/bricks/store_writer.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <atomic>
#include <map>
#include <mutex>

#include "isobrick/bricks/array_metadata.h"
#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/image_metadata.h"
#include "isobrick/bricks/publisher.h"
#include "isobrick/bricks/range_array.h"
#include "isobrick/bricks/shard_grid.h"
#include "isobrick/bricks/shard_index.h"
#include "isobrick/bricks/store_names.h"
#include "isobrick/bricks/stored_ranges.h"
#include "isobrick/bricks/zarr_v2.h"
#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

// Shards being written keep their file open while there are no more than so
// many; those beyond reopen it for each brick.
constexpr int kMaxOpenShards = 256;

// Bytes of a shard after which the disk starts on them.
constexpr std::uint64_t kWriteback = std::uint64_t{8} << 20;

struct OpenShard {
  explicit OpenShard(std::size_t bricks) : index(bricks) {}
  std::mutex mutex;
  std::filesystem::path path;
  File file;  // empty when closed between bricks
  bool created = false;
  bool counted = false;  // one of kMaxOpenShards
  std::uint64_t end = 0;
  std::uint64_t writeback_end = 0;  // the disk was told of what is before
  ShardIndex index;
};

}  // namespace

struct StoreWriter::Impl {
  struct Level {
    Lattice lattice;
    ShardGrid grid;
    ArrayMetadata metadata;
    std::filesystem::path folder;
    std::unique_ptr<RangeArrayWriter> brick_ranges, block_ranges;
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

  std::filesystem::path dir;
  StoreLayout layout;
  bool resume;
  std::vector<Level> levels;
  std::atomic<int> open_files = 0;
  std::mutex mutex;
  std::map<std::pair<int, Index>, std::shared_ptr<OpenShard>> open_shards;
  std::unique_ptr<Publisher> publisher;
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
    for (const auto& entry : std::filesystem::recursive_directory_iterator(dir))
      if (!entry.is_directory() && is_temporary_name(entry.path()))
        publisher->folder().remove_file(entry.path());
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
    l.brick_ranges = std::make_unique<RangeArrayWriter>(
        brick_range_folder(dir, number), l.lattice.bricks(), l.lattice.type, *publisher);
    l.block_ranges = std::make_unique<RangeArrayWriter>(
        block_range_folder(dir, number), l.lattice.blocks(), l.lattice.type, *publisher);
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

bool StoreWriter::shard_is_whole(int level, Int3 s) const {
  const Impl::Level& l = impl_->level(level);
  if (!impl_->resume) return false;
  const std::filesystem::path path = impl_->shard_path(l, s);
  const File file = impl_->publisher->folder().open_file(path, O_RDONLY);
  if (!file) return false;
  if (!l.metadata.sharding) return true;  // it has its name only when it is whole
  const std::uint64_t size = file.size();
  const std::uint64_t index_size = ShardIndex::encoded_size(l.grid.shard_bricks(), true);
  if (size < index_size) return false;
  std::vector<std::byte> bytes(index_size);
  file.read_at(size - index_size, bytes);
  try {
    // The bricks of our shards leave no gaps, so their sizes tell the file's.
    return ShardIndex::decode(bytes, true, size - index_size).brick_bytes() == size - index_size;
  } catch (const DamageError&) {
    return false;
  }
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
    if (impl_->resume) impl_->publisher->folder().remove_file(impl_->shard_path(l, s));
    return;
  }
  const std::lock_guard lock(shard->mutex);
  if (l.metadata.sharding) impl_->write(*shard, shard->index.encode());
  if (!shard->file) impl_->reopen(*shard);
  if (shard->counted) --impl_->open_files;
  impl_->publisher->publish(std::move(shard->file), shard->path);
  const std::lock_guard map_lock(impl_->mutex);
  impl_->open_shards.erase({level, linear_index(s, l.grid.shards)});
}

void StoreWriter::put_brick_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  impl_->level(level).brick_ranges->put(box, pairs);
}

void StoreWriter::put_block_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  impl_->level(level).block_ranges->put(box, pairs);
}

void StoreWriter::Impl::publish_root(const ImageMetadata& image) {
  const RootFile file = root_file(image, layout.ome);
  const std::filesystem::path root = dir / file.name;
  publisher->sync(publisher->write_temporary(root, std::as_bytes(std::span(file.json))));
  publisher->wait();
  publisher->folder().rename_file(temporary_name(root), root);
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
  StoredRanges ranges{.may_have_nan = may_have_nan, .image_crc32c = 0, .levels = {}};
  for (std::size_t i = 0; i < impl_->levels.size(); ++i) {
    Impl::Level& l = impl_->levels[i];
    const auto bricks = l.brick_ranges->finish(), blocks = l.block_ranges->finish();
    if (bricks && blocks) ranges.levels.push_back({*bricks, *blocks});
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
      layout_checksum(image, layout, quoted(impl_->dir / root_file(image, layout.ome).name));
  ranges.image_crc32c = *image.checksum;
  if (ranges.levels.size() == impl_->levels.size())
    publisher.write(ranges_file(impl_->dir), to_json(ranges));
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
