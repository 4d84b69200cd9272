#include "pipeline/index/level_index.h"

#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/stored_index.h"
#include "bricks/zarr/json_reader.h"
#include "core/morton.h"
#include "io/bytes/exchange.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_folder.h"
#include "pipeline/index/add_ranges.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr int kZstdLevel = 3;

/// Compressed if the store is, at its level where that is one that we write.
std::optional<int> zstd_level_of(const StoreInfo& info) {
  if (info.codec == "none") return std::nullopt;
  constexpr std::string_view kPrefix = "zstd:";
  int level = 0;
  if (info.codec.starts_with(kPrefix))
    std::from_chars(info.codec.data() + kPrefix.size(), info.codec.data() + info.codec.size(),
                    level);
  return level >= 1 && level <= 22 ? level : kZstdLevel;
}

}  // namespace

bool needs_ranges(const StoreReader& store, const IndexOptions& options) {
  return (!store.info().ours && options.force) || !has_all_ranges(store);
}

IndexLayout index_layout(const StoreReader& store, int level, const IndexOptions& options) {
  return index_layout(store, level, std::string(name_of(options.kind)), options.leaf);
}

IndexLayout index_layout(const StoreReader& store, int level, std::string kind, Index leaf) {
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  return {.kind = std::move(kind),
          .leaf = leaf,
          .type = surface_type(store.info().type),
          .extent = info.lattice.extent,
          .zstd_level = zstd_level_of(store.info()),
          .ranges_crc32c = info.block_ranges_crc32c};
}

LevelIndex::LevelIndex(const StoreReader& store, int level, const IndexOptions& options,
                       IndexLayout layout)
    : store_(store),
      level_(level),
      options_(options),
      entries_(StoreEntries::of(store.info().levels)),
      layout_(std::move(layout)),
      index_folder_in_store_(index_folder("", level, layout_.kind)),
      place_(store.storage()->local_path() /
             index_folder(store.info().additions, level, layout_.kind)),
      partial_(place_) {
  partial_ += ".partial";
}

void LevelIndex::publish(const OutputFolder& folder) const {
  if (!finished_) folder.replace_folder(partial_, place_);
  // What a kill may have left of an index that was replaced.
  remove(folder, set_aside_name(place_));
}

bool LevelIndex::has_chunk(Int3 chunk) const {
  if (!options_.resume) return false;
  const bool finished = is_finished();
  if (!finished && !is_wanted(partial_)) return false;
  return IndexChunk::is_whole((finished ? place_ : partial_) / index_chunk_name(chunk),
                              layout_.parts_of_chunk(chunk), {chunk, checksum_of(layout_)});
}

/// Whether the description in `folder` is that of the index to build.
bool LevelIndex::is_wanted(const fs::path& folder) const {
  const fs::path file = folder / kIndexDescription;
  const auto text = read_small_file(file, kMaxMetadataBytes);
  try {
    return text && parse_index_layout(*text, quoted(file)) == layout_;
  } catch (const DamageError&) {
    return false;
  }
}

/// Whether an earlier run has ended, whose index stays. Parts are joined to replace it where
/// `force` is set; the rest of a join that was interrupted stays all the same.
bool LevelIndex::is_finished() const {
  return options_.resume && !(options_.join > 0 && options_.force) && is_wanted(place_);
}

void LevelIndex::remove(const OutputFolder& root, const fs::path& folder) const {
  if (!fs::exists(folder)) return;
  check_replaceable(folder, entries_, place_in_store());
  root.remove_folder(folder);
}

void LevelIndex::check() const {
  for (const fs::path& folder : {place_, partial_})
    check_replaceable(folder, entries_, place_in_store());
  if (options_.force) return;
  const bool finished = is_finished();
  if (fs::exists(place_) && !finished)
    throw UsageError(fmt::format("'{}' has the {} index already; --force replaces it",
                                 store_.info().name, layout_.kind));
  // Beside a finished one it is the one that was replaced.
  if (finished || !fs::exists(partial_)) return;
  if (!options_.resume)
    throw UsageError(
        fmt::format("an interrupted build is in '{}'; --resume goes on with it, --force starts "
                    "anew",
                    partial_.string()));
  if (fs::exists(partial_ / kIndexDescription) && !is_wanted(partial_))
    throw UsageError(
        fmt::format("'{}' was begun with another leaf; resume with the same one, or "
                    "--force starts anew",
                    partial_.string()));
}

void LevelIndex::prepare(Publisher& publisher) {
  finished_ = is_finished();
  if (finished_ || !(options_.resume && is_wanted(partial_))) remove(publisher.folder(), partial_);
  if (finished_) return;
  for_each_point({{0, 0, 0}, layout_.chunks()},
                 [&](Int3 c) { publisher.discard_temporary(partial_ / index_chunk_name(c)); });
  publisher.write(partial_ / kIndexDescription, to_json(layout_));
  publisher.wait();  // before any chunk, which would else be of nobody knows what
}

void build_index_chunk(const MakeIndexParts& make, const IndexLayout& layout,
                       const IndexChunkName& name, const fs::path& path, Publisher& publisher) {
  IndexChunkWriter writer(publisher, path, layout.parts_of_chunk(name.chunk), name);
  // The directory comes first in the file, and may be made last: what is made before it waits.
  struct Waiting {
    std::size_t part, bytes;
  };
  std::vector<Waiting> waiting;
  std::unique_ptr<FileWriter> scratch;
  bool has_directory = layout.kind == kLabelIndex;  // of labels it is the last part
  make(
      name.chunk,
      [&](std::vector<std::byte> part) { return encode_index_part(layout.zstd_level, part); },
      [&](std::size_t part, std::vector<std::byte> encoded) {
        has_directory = has_directory || part == IndexLayout::kDirectory;
        if (has_directory) return writer.append(part, encoded);
        if (!scratch) scratch = std::make_unique<FileWriter>(open_scratch_beside(path.string()));
        waiting.push_back({part, encoded.size()});
        scratch->append(encoded);
      });
  PodBuffer<std::byte> bytes;
  std::uint64_t offset = 0;
  for (const Waiting& of : waiting) {
    bytes.resize(of.bytes);
    scratch->read_back(offset, {bytes.data(), bytes.size()});
    writer.append(of.part, {bytes.data(), bytes.size()});
    offset += of.bytes;
  }
  writer.publish();
}

void LevelIndex::build(const MakeIndexParts& make, Publisher& publisher, Progress& progress,
                       IndexReport& report, const TakeIndexChunk& take) const {
  const std::uint32_t checksum = checksum_of(layout_);
  std::uint64_t bytes = 0;
  for_each_morton(layout_.chunks(), [&](Int3 c) {
    const fs::path path = (finished_ ? place_ : partial_) / index_chunk_name(c);
    const IndexChunkName name{c, checksum};
    const bool taken = !finished_ && take && take(name, path);
    const bool kept = finished_ || (!taken && options_.resume &&
                                    IndexChunk::is_whole(path, layout_.parts_of_chunk(c), name));
    if (!taken && !kept) build_index_chunk(make, layout_, name, path, publisher);
    ++report.chunks;
    report.chunks_kept += kept;
    const Int3 bricks = layout_.bricks_of_chunk(c).extent();
    progress.advance(static_cast<std::uint64_t>(volume(bricks)));
  });
  publisher.wait();
  for_each_morton(layout_.chunks(), [&](Int3 c) {
    bytes += fs::file_size((finished_ ? place_ : partial_) / index_chunk_name(c));
  });
  bytes += fs::file_size((finished_ ? place_ : partial_) / kIndexDescription);
  report.level_bytes.push_back(bytes);
}

}  // namespace isobrick
