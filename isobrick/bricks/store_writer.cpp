#include "isobrick/bricks/store_writer.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "isobrick/bricks/array_metadata.h"
#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/image_metadata.h"
#include "isobrick/bricks/ome_transformations.h"
#include "isobrick/bricks/publisher.h"
#include "isobrick/bricks/range_array.h"
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

ArrayMetadata array_metadata(const LevelInfo& level, const StoreLayout& layout) {
  ArrayMetadata array;
  const Int3 e = level.lattice.extent, b = level.lattice.brick, s = level.shard;
  array.shape = {e.z, e.y, e.x};
  array.chunk = {s.z, s.y, s.x};
  array.type = level.lattice.type;
  array.fill_value = layout.fill_value;
  array.codecs = layout.codecs();
  if (layout.ome == OmeVersion::v04) {
    array.key_prefix = false;
    return array;
  }
  array.sharding.emplace().brick = {b.z, b.y, b.x};
  array.dimension_names = {"z", "y", "x"};
  return array;
}

ImageMetadata image_metadata(const StoreLayout& layout) {
  ImageMetadata image;
  image.name = layout.name;
  image.grid_class = layout.grid_class;
  image.grid_name = layout.grid_name;
  if (layout.levels.size() > 1) image.downsampling = name_of(layout.downsampling);
  for (std::size_t i = 0; i < layout.levels.size(); ++i)
    image.levels.push_back({std::to_string(i), layout.levels[i].transform});
  return image;
}

// The file whose name makes a folder a store.
struct RootFile {
  const char* name;
  std::string json;
};

RootFile root_file(const ImageMetadata& image, OmeVersion ome) {
  if (ome == OmeVersion::v04) return {".zattrs", to_zattrs(image)};
  return {"zarr.json", to_json(image)};
}

// The metadata must survive its own parser: that is the one place where limits
// on extents, bricks and shards are checked.
void check_layout(const StoreLayout& layout) {
  if (layout.levels.empty()) throw UsageError("a store needs at least one level");
  for (std::size_t i = 0; i < layout.levels.size(); ++i) {
    const LevelInfo& level = layout.levels[i];
    if (level.lattice.type != layout.levels[0].lattice.type)
      throw UsageError("all levels of a store have the same type");
    if (!checked_volume(level.lattice.extent)) throw UsageError("extents are out of bounds");
    if (layout.ome == OmeVersion::v04 && level.shard != level.lattice.brick)
      throw UsageError("Zarr version 2 has no shards");
    const Transform& transform = level.transform;
    for (int axis = 0; axis < 3; ++axis) {
      if (level.lattice.extent[axis] > kMaxAxisSamples)
        throw UsageError(
            fmt::format("more than {} samples along an axis are not supported", kMaxAxisSamples));
      if (!(transform.spacing[axis] > 0) || !std::isfinite(transform.spacing[axis]))
        throw Error(fmt::format("level {}: a spacing of {} is not finite and positive", i,
                                transform.spacing[axis]));
      if (!std::isfinite(transform.origin[axis]))
        throw Error(
            fmt::format("level {}: an origin of {} is not finite", i, transform.origin[axis]));
    }
    if (!is_orthonormal(transform.direction))
      throw Error(fmt::format("level {}: the axes' directions are not orthonormal", i));
    fill_bits(level.lattice.type, layout.fill_value);
    parse_array_metadata(to_json(array_metadata(level, layout)), fmt::format("level {}", i));
  }
  parse_image_metadata(to_json(image_metadata(layout)), "metadata");
}

// What a resume compares: all metadata but may_have_nan, which is known last.
nlohmann::json layout_marker(const StoreLayout& layout) {
  nlohmann::json marker;
  marker["isobrick_layout"] = kStoreVersion;
  marker["image"] = nlohmann::json::parse(to_json(image_metadata(layout)));
  for (const LevelInfo& level : layout.levels)
    marker["arrays"].push_back(nlohmann::json::parse(to_json(array_metadata(level, layout))));
  return marker;
}

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
    Int3 shard, shards;
    Int3 bricks_per_shard;
    ArrayMetadata metadata;
    std::filesystem::path folder;
    std::unique_ptr<RangeArrayWriter> brick_ranges, block_ranges;
  };

  Impl(const std::filesystem::path& directory, const StoreLayout& store_layout, bool is_resume)
      : dir(directory), layout(store_layout), resume(is_resume) {}

  void begin();
  void check_resume();
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
  std::uint32_t checksum_of(const ImageMetadata& image) const;
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
  const nlohmann::json begun = parse_json(*text, quoted(marker_path));
  const nlohmann::json wanted = layout_marker(layout);
  if (begun == wanted) return;
  const nlohmann::json differences = nlohmann::json::diff(begun, wanted);
  throw Error(
      fmt::format("'{}' was begun with another layout ({} differs); resume with the same one",
                  dir.string(), differences.at(0).at("path").get<std::string>()));
}

void StoreWriter::Impl::begin() {
  check_layout(layout);
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
    const std::string text = layout_marker(layout).dump(1) + "\n";
    File marker = publisher->write_temporary(dir / kLayoutMarker, std::as_bytes(std::span(text)));
    publisher->folder().rename_file(marker.path(), dir / kLayoutMarker);
    publisher->sync(std::move(marker));
  }
  for (std::size_t i = 0; i < layout.levels.size(); ++i) {
    const LevelInfo& info = layout.levels[i];
    Level& l = levels.emplace_back();
    l.lattice = info.lattice;
    l.shard = info.shard;
    l.shards = ceil_div(info.lattice.extent, info.shard);
    l.bricks_per_shard = ceil_div(info.shard, info.lattice.brick);
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
  const std::pair key(i, linear_index(s, l.shards));
  if (const auto found = open_shards.find(key); found != open_shards.end()) return found->second;
  // Made first: where memory is short, no entry stays without its shard.
  auto shard = std::make_shared<OpenShard>(static_cast<std::size_t>(volume(l.bricks_per_shard)));
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
  impl_->begin();
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
  const auto bricks = static_cast<std::uint64_t>(volume(l.bricks_per_shard));
  const std::uint64_t index_size = ShardIndex::encoded_size(bricks, true);
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
  const Int3 n = l.bricks_per_shard;
  const Int3 s{brick.x / n.x, brick.y / n.y, brick.z / n.z};
  const auto i = static_cast<std::size_t>(linear_index(brick - s * n, n));
  const auto shard = impl_->open_shard(level, s);
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
  if (!Box3{{0, 0, 0}, l.shards}.contains(s))
    throw UsageError(fmt::format("level {} has no shard ({}, {}, {})", level, s.x, s.y, s.z));
  std::shared_ptr<OpenShard> shard;
  {
    const std::lock_guard lock(impl_->mutex);
    const auto found = impl_->open_shards.find({level, linear_index(s, l.shards)});
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
  impl_->open_shards.erase({level, linear_index(s, l.shards)});
}

void StoreWriter::put_brick_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  impl_->level(level).brick_ranges->put(box, pairs);
}

void StoreWriter::put_block_ranges(int level, Box3 box, std::span<const std::byte> pairs) {
  impl_->level(level).block_ranges->put(box, pairs);
}

// Over what a reader will find, which Zarr version 2 says in other words.
std::uint32_t StoreWriter::Impl::checksum_of(const ImageMetadata& image) const {
  const RootFile root = root_file(image, layout.ome);
  const std::string where = quoted(dir / root.name);
  std::vector<std::string> texts;
  for (const Level& l : levels)
    texts.push_back(layout.ome == OmeVersion::v04 ? v3_from_zarray(to_zarray(l.metadata), where)
                                                  : to_json(l.metadata));
  return metadata_checksum(
      layout.ome == OmeVersion::v04 ? v3_from_zattrs(root.json, where) : root.json, texts, where);
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
  image.checksum = impl_->checksum_of(image);
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
