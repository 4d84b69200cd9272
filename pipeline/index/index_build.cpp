#include <isobrick/index_build.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string_view>

#include <isobrick/error.h>
#include "bricks/store_entries.h"
#include "bricks/stored_index.h"
#include "bricks/zarr/json_reader.h"
#include "core/cancellable_progress.h"
#include "core/morton.h"
#include "core/stopwatch.h"
#include "index/leaf_ranges.h"
#include "io/bytes/exchange.h"
#include "io/bytes/output_folder.h"
#include "io/bytes/url.h"
#include "pipeline/index/add_ranges.h"
#include "pipeline/index/index_chunk_builder.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr int kZstdLevel = 3;

std::string kind_of(const IndexOptions& options) { return std::string(name_of(options.kind)); }

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

/// One level's index on its way into the store.
class LevelIndex {
 public:
  LevelIndex(const StoreReader& store, int level, const IndexOptions& options)
      : store_(store),
        level_(level),
        options_(options),
        entries_(StoreEntries::of(store.info().levels)),
        place_(store.storage()->local_path() /
               index_folder(store.info().additions, level, kind_of(options))),
        partial_(place_) {
    partial_ += ".partial";
    layout_.kind = kind_of(options);
    layout_.leaf = options.leaf;
    layout_.type = store.info().type;
    layout_.extent = store.info().levels[static_cast<std::size_t>(level)].lattice.extent;
    layout_.zstd_level = zstd_level_of(store.info());
    layout_.ranges_crc32c =
        store.info().levels[static_cast<std::size_t>(level)].block_ranges_crc32c;
  }

  /// Throws UsageError when there is one and neither `resume` nor `force` is set.
  void check() const;
  /// Decides what of an earlier run stays, and makes the folder.
  void prepare(Publisher& publisher);
  void build(std::uint64_t memory, int threads, Publisher& publisher, Progress& progress,
             IndexReport& report) const;
  void publish(const OutputFolder& folder) const {
    if (!finished_) folder.replace_folder(partial_, place_);
    // What a kill may have left of an index that was replaced.
    remove(folder, set_aside_name(place_));
  }

 private:
  fs::path place_in_store() const { return index_folder("", level_, layout_.kind); }
  void remove(const OutputFolder& root, const fs::path& folder) const;
  bool is_wanted(const fs::path& folder) const;
  void build_chunk(const IndexChunkBuilder& builder, const IndexChunkName& name,
                   Publisher& publisher) const;

  const StoreReader& store_;
  int level_;
  const IndexOptions& options_;
  StoreEntries entries_;
  fs::path place_, partial_;
  IndexLayout layout_;
  bool finished_ = false;  ///< by an earlier run
};

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

void LevelIndex::remove(const OutputFolder& root, const fs::path& folder) const {
  if (!fs::exists(folder)) return;
  check_replaceable(folder, entries_, place_in_store());
  root.remove_folder(folder);
}

void LevelIndex::check() const {
  for (const fs::path& folder : {place_, partial_})
    check_replaceable(folder, entries_, place_in_store());
  if (options_.force) return;
  const bool finished = options_.resume && is_wanted(place_);
  if (fs::exists(place_) && !finished)
    throw UsageError(
        fmt::format("'{}' has a {} index; --force replaces it", store_.info().name, layout_.kind));
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
  finished_ = options_.resume && is_wanted(place_);
  if (finished_ || !(options_.resume && is_wanted(partial_))) remove(publisher.folder(), partial_);
  if (finished_) return;
  for_each_point({{0, 0, 0}, layout_.chunks()},
                 [&](Int3 c) { publisher.discard_temporary(partial_ / index_chunk_name(c)); });
  publisher.write(partial_ / kIndexDescription, to_json(layout_));
  publisher.wait();  // before any chunk, which would else be of nobody knows what
}

void LevelIndex::build_chunk(const IndexChunkBuilder& builder, const IndexChunkName& name,
                             Publisher& publisher) const {
  const Int3 c = name.chunk;
  IndexChunkWriter writer(publisher, partial_ / index_chunk_name(c), layout_.parts_of_chunk(c),
                          name);
  builder.build(
      c, [&](std::vector<std::byte> part) { return encode_index_part(layout_.zstd_level, part); },
      [&](std::size_t part, std::vector<std::byte> encoded) { writer.append(part, encoded); });
  writer.publish();
}

void LevelIndex::build(std::uint64_t memory, int threads, Publisher& publisher, Progress& progress,
                       IndexReport& report) const {
  const IndexChunkBuilder builder(store_, level_, layout_, options_.kind, memory, threads);
  const std::uint32_t checksum = checksum_of(layout_);
  std::uint64_t bytes = 0;
  for_each_morton(layout_.chunks(), [&](Int3 c) {
    const fs::path path = (finished_ ? place_ : partial_) / index_chunk_name(c);
    const IndexChunkName name{c, checksum};
    const bool kept = finished_ || (options_.resume &&
                                    IndexChunk::is_whole(path, layout_.parts_of_chunk(c), name));
    if (!kept) build_chunk(builder, name, publisher);
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

/// Adds what is missing of the ranges, and opens the store again to find it.
void complete_ranges(std::unique_ptr<StoreReader>& store, const IndexOptions& options, int threads,
                     Progress& progress, IndexReport& report) {
  const bool anew = !store->info().ours && options.force;
  if (!anew && has_all_ranges(*store)) return;
  Stopwatch watch;
  add_ranges(*store, options.memory, threads, progress);
  store = std::make_unique<StoreReader>(store->storage(), options.selection);
  report.ranges_added = true;
  report.range_seconds = watch.lap();
}

IndexReport build_all(const fs::path& path, const IndexOptions& given, int threads,
                      Progress& progress) {
  IndexReport report;
  auto store = std::make_unique<StoreReader>(path, given.selection);
  // What decoding takes beyond bricks is nobody else's.
  IndexOptions options = given;
  options.memory -= std::min(options.memory, decode_extra(store->info(), threads));
  check_index_options(given, store->info().levels.front().lattice, given.memory - options.memory);
  const UniqueFd lock = lock_store(path);
  const auto level_count = static_cast<int>(store->info().levels.size());
  for (int level = 0; level < level_count; ++level) LevelIndex(*store, level, options).check();
  complete_ranges(store, options, threads, progress, report);

  std::vector<LevelIndex> levels;
  std::uint64_t bricks = 0;
  for (int level = 0; level < level_count; ++level) {
    levels.emplace_back(*store, level, options);
    bricks += static_cast<std::uint64_t>(
        volume(ceil_div(store->info().levels[static_cast<std::size_t>(level)].lattice.extent,
                        {IndexLayout::kBrick, IndexLayout::kBrick, IndexLayout::kBrick})));
  }
  Publisher publisher(path);
  progress.begin("index", bricks);
  for (LevelIndex& level : levels) {
    level.prepare(publisher);
    level.build(options.memory, threads, publisher, progress, report);
  }
  for (const LevelIndex& level : levels) level.publish(publisher.folder());
  progress.end();
  return report;
}

}  // namespace

std::uint64_t min_index_memory(const IndexOptions& options, const Lattice& lattice) {
  if (options.kind == IndexKind::linear)
    throw UsageError("a linear scan needs no index: that is what a store's ranges are for");
  if (!is_leaf(options.leaf))
    throw UsageError(
        fmt::format("a leaf has 1, 2, 4, 8 or 16 cells along an edge, not {}", options.leaf));
  return IndexChunkBuilder::min_memory(lattice, options.leaf, Workers(options.threads).threads());
}

void check_index_options(const IndexOptions& options, const Lattice& lattice,
                         std::uint64_t others) {
  const std::uint64_t least = others + min_index_memory(options, lattice);
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: an index with leaf {} needs --memory {}M at "
        "least, {} MiB of it for the program and its libraries, the rest for {} threads that read "
        "and build",
        in_mib(options.memory), options.leaf, mib_above(least), kProgramBytes >> 20,
        Workers(options.threads).threads()));
}

IndexReport add_index(const fs::path& store, const IndexOptions& options, Progress& listener) {
  if (is_url(store.native()))
    throw UsageError(fmt::format(
        "'{0}': nothing can be written to a URL; make a store of it: isobrick convert {0} OUT.zarr",
        store.native()));
  CancellableProgress progress(listener, options.cancel);
  Stopwatch watch;
  Workers workers(options.threads);
  IndexReport report =
      workers.execute([&] { return build_all(store, options, workers.threads(), progress); });
  report.seconds = watch.lap();
  return report;
}

}  // namespace isobrick
