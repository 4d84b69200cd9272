#include <isobrick/index_build.h>

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/label_index.h>
#include "core/cancellable_progress.h"
#include "core/stopwatch.h"
#include "index/leaf_ranges.h"
#include "io/bytes/url.h"
#include "pipeline/check_part.h"
#include "pipeline/index/add_ranges.h"
#include "pipeline/index/index_chunk_builder.h"
#include "pipeline/index/index_join.h"
#include "pipeline/index/index_part.h"
#include "pipeline/index/label_chunk_builder.h"
#include "pipeline/index/level_index.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// What an index has.
struct IndexContents {
  std::function<IndexLayout(const StoreReader& store, int level)> layout;
  /// What makes the parts of a level, in so much memory.
  std::function<MakeIndexParts(const StoreReader& store, int level, const IndexLayout& layout,
                               std::uint64_t memory, int threads)>
      builder;
  /// Throws UsageError where the budget, of which `others` bytes are in use, is too small.
  std::function<void(const Lattice& lattice, std::uint64_t others)> check;
};

IndexContents span_index(const IndexOptions& options) {
  return {.layout = [&](const StoreReader& store,
                        int level) { return index_layout(store, level, options); },
          .builder =
              [&](const StoreReader& store, int level, const IndexLayout& layout,
                  std::uint64_t memory, int threads) {
                return span_index_parts(store, level, layout, options.kind, memory, threads);
              },
          .check = [&](const Lattice& lattice,
                       std::uint64_t others) { check_index_options(options, lattice, others); }};
}

IndexContents label_index(const LabelIndexOptions& options) {
  return {.layout = label_index_layout,
          .builder = label_index_parts,
          .check = [&](const Lattice& lattice, std::uint64_t others) {
            check_label_index_options(options, lattice, others);
          }};
}

/// An index on its way into a store, in one process or out of parts.
class IndexBuild {
 public:
  /// `contents` must outlive it.
  IndexBuild(const fs::path& path, const IndexOptions& given, const IndexContents& contents,
             int threads, Progress& progress)
      : path_(path),
        options_(given),
        contents_(contents),
        threads_(threads),
        progress_(progress),
        store_(std::make_unique<StoreReader>(path, given.selection)) {
    // What decoding takes beyond bricks is nobody else's.
    options_.memory -= std::min(given.memory, decode_extra(store_->info(), threads));
    contents.check(store_->info().levels.front().lattice, given.memory - options_.memory);
    options_.resume |= given.join > 0;  // what an interrupted join has moved is in no part any more
  }

  IndexReport run();
  IndexReport make_part() {
    check_can_add(path_);
    return make_index_part(*store_, options_, options_.memory, threads_, progress_);
  }

 private:
  std::vector<LevelIndex> levels() const {
    std::vector<LevelIndex> all;
    for (int level = 0; level < static_cast<int>(store_->info().levels.size()); ++level)
      all.emplace_back(*store_, level, options_, contents_.layout(*store_, level));
    return all;
  }
  void complete_ranges(const std::optional<JoinedIndexParts>& parts, IndexReport& report);

  const fs::path& path_;
  IndexOptions options_;
  const IndexContents& contents_;
  int threads_;
  Progress& progress_;
  std::unique_ptr<StoreReader> store_;
};

/// Adds what is missing of the ranges.
void IndexBuild::complete_ranges(const std::optional<JoinedIndexParts>& parts,
                                 IndexReport& report) {
  if (!needs_ranges(*store_, options_)) return;
  Stopwatch watch;
  if (parts)
    parts->add_ranges(options_.memory, progress_);
  else
    add_ranges(*store_, options_.memory, threads_, progress_);
  report.ranges_added = true;
  report.range_seconds = watch.lap();
}

IndexReport IndexBuild::run() {
  IndexReport report;
  const UniqueFd lock = lock_store(path_);
  std::unique_ptr<StoreReader> before;  // the parts know the store as it is now
  std::optional<JoinedIndexParts> parts;
  {
    const std::vector<LevelIndex> begun = levels();
    for (const LevelIndex& level : begun) level.check();
    if (options_.join > 0) parts.emplace(*store_, options_, begun);
  }
  complete_ranges(parts, report);
  if (report.ranges_added) {
    before = std::move(store_);
    store_ = std::make_unique<StoreReader>(before->storage(), options_.selection);
  }
  std::vector<LevelIndex> levels = this->levels();
  std::uint64_t bricks = 0;
  for (const LevelInfo& level : store_->info().levels)
    bricks += static_cast<std::uint64_t>(volume(ceil_div(
        level.lattice.extent, {IndexLayout::kBrick, IndexLayout::kBrick, IndexLayout::kBrick})));
  Publisher publisher(path_);
  progress_.begin("index", bricks);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    levels[i].prepare(publisher);
    const int level = static_cast<int>(i);
    levels[i].build(
        contents_.builder(*store_, level, levels[i].layout(), options_.memory, threads_), publisher,
        progress_, report, parts ? parts->chunks_of(level, publisher) : nullptr);
  }
  for (const LevelIndex& level : levels) level.publish(publisher.folder());
  progress_.end();
  if (parts) parts->remove();
  return report;
}

void refuse_url(const fs::path& store) {
  if (is_url(store.native()))
    throw UsageError(fmt::format(
        "'{0}': nothing can be written to a URL; make a store of it: isobrick convert {0} OUT.zarr",
        store.native()));
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
  refuse_url(store);
  if (options.part && options.join > 0)
    throw UsageError("a part is made or all parts are joined, not both at once");
  if (options.part) check_part(*options.part);
  if (options.join > kMaxParts)
    throw UsageError(fmt::format("there are at most {} parts, not {}", kMaxParts, options.join));
  CancellableProgress progress(listener, options.cancel);
  Stopwatch watch;
  Workers workers(options.threads);
  IndexReport report = workers.execute([&] {
    const IndexContents contents = span_index(options);
    IndexBuild build(store, options, contents, workers.threads(), progress);
    return options.part ? build.make_part() : build.run();
  });
  report.seconds = watch.lap();
  return report;
}

void check_label_index_options(const LabelIndexOptions& options, const Lattice& lattice,
                               std::uint64_t others) {
  const std::uint64_t least =
      others + LabelChunkBuilder::min_memory(lattice, Workers(options.threads).threads());
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: lists of labels need --memory {}M at least",
        in_mib(options.memory), mib_above(least)));
}

IndexReport add_label_index(const fs::path& store, const LabelIndexOptions& options,
                            Progress& listener) {
  refuse_url(store);
  CancellableProgress progress(listener, options.cancel);
  Stopwatch watch;
  Workers workers(options.threads);
  const IndexOptions build{.selection = options.selection,
                           .memory = options.memory,
                           .threads = options.threads,
                           .resume = options.resume,
                           .force = options.force};
  const IndexContents contents = label_index(options);
  IndexReport report = workers.execute(
      [&] { return IndexBuild(store, build, contents, workers.threads(), progress).run(); });
  report.seconds = watch.lap();
  return report;
}

}  // namespace isobrick
