#include "pipeline/index/index_join.h"

#include <fcntl.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/ranges/brick_checksums.h"
#include "io/bytes/output_folder.h"
#include "pipeline/check_part.h"
#include "pipeline/index/add_ranges.h"
#include "pipeline/index/part_ranges_file.h"
#include "pipeline/index/range_scan.h"
#include "pipeline/program_memory.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

std::tuple<int, Index, Index, Index> place_of(int level, Int3 chunk) {
  return {level, chunk.z, chunk.y, chunk.x};
}

/// Hands a record on to where it belongs.
void put(const PartRangesReader& file, const PartRecord& record, LevelRanges& ranges,
         LevelRangeOutput& output) {
  const std::vector<std::byte> bytes = file.read(record);
  switch (record.kind) {
    case PartRecord::Kind::blocks: return ranges.merge_blocks(record.items, bytes);
    case PartRecord::Kind::bricks: return ranges.merge_bricks(record.items, bytes);
    case PartRecord::Kind::checksums:
      output.put_checksums(record.items, {reinterpret_cast<const std::uint32_t*>(bytes.data()),
                                          bytes.size() / sizeof(std::uint32_t)});
  }
}

[[noreturn]] void changed_meanwhile(const fs::path& file) {
  throw Error(fmt::format("'{}' has changed meanwhile", file.string()));
}

}  // namespace

JoinedIndexParts::JoinedIndexParts(const StoreReader& store, const IndexOptions& options,
                                   const std::vector<LevelIndex>& levels)
    : store_(store), options_(options), parts_(store, options, options.join) {
  const bool lacks_ranges = needs_ranges(store, options);
  std::set<std::uint32_t> missing;
  for (std::uint32_t number = 1; number <= parts_.count(); ++number) {
    bool has_bricks = false;
    for (int level = 0; level < static_cast<int>(levels.size()); ++level)
      has_bricks = has_bricks || !parts_.bricks(level, number).empty();
    if (lacks_ranges && has_bricks &&
        !PartRangesReader::open(parts_.ranges_file(number), {number, parts_.count()},
                                parts_.ranges_state(number), store.info().levels, true))
      missing.insert(number);
    for (const IndexParts::Chunk& chunk : parts_.chunks(number)) {
      const IndexLayout layout = index_layout(store, chunk.level, options);
      const std::size_t count = layout.parts_of_chunk(chunk.chunk);
      const Found found{parts_.chunk_file(number, chunk), parts_.name_of(chunk)};
      // An interrupted join may have given it its last name already, or have taken it. Should the
      // ranges become others than they are now, the join makes such a chunk itself.
      const IndexChunkName last{chunk.chunk, checksum_of(layout)};
      if (IndexChunk::is_whole(found.path, count, found.name) ||
          IndexChunk::is_whole(found.path, count, last))
        chunks_.emplace(place_of(chunk.level, chunk.chunk), found);
      else if (!levels[static_cast<std::size_t>(chunk.level)].has_chunk(chunk.chunk))
        missing.insert(number);
    }
  }
  if (missing.empty()) return;
  throw UsageError(fmt::format(
      "'{}' has no whole part{} {} of the store as it is now; index it with the same options and "
      "--part {}/{}",
      parts_.folder().string(), missing.size() == 1 ? "" : "s", numbers_of_parts(missing),
      *missing.begin(), parts_.count()));
}

void JoinedIndexParts::add_ranges(std::uint64_t memory, Progress& progress) const {
  std::uint64_t least = 0, total = 0;
  for (const LevelInfo& level : store_.info().levels) {
    const Lattice& lattice = level.lattice;
    // What is open, what is gathered to be written, and a layer that is read.
    const Int3 blocks = lattice.blocks(), bricks = lattice.bricks();
    const auto layer = static_cast<std::uint64_t>(blocks.x * blocks.y + bricks.x * bricks.y) * 2 *
                       lattice.sample_bytes();
    least = std::max(least, kProgramBytes + level_ranges_bytes(lattice, lattice.brick.z) +
                                gathered_ranges_bytes(lattice) + brick_checksum_bytes(level) +
                                value_counts_bytes(lattice.type, 1) + layer +
                                kMaxHistogramBins * sizeof(std::uint64_t));
    total += parts_.count();
  }
  if (memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: joining ranges needs --memory {}M at least",
        in_mib(memory), mib_above(least)));
  const auto counts = make_value_counts(store_.info().stored_type);
  progress.begin("ranges", total);
  replace_ranges(
      store_.native(),
      [&](int level, LevelRangeOutput& output) { return merge(level, output, *counts, progress); },
      *counts);
  progress.end();
}

/// Whether any sample of a part that has bricks of the level is NaN.
bool JoinedIndexParts::merge(int level, LevelRangeOutput& output, ValueCounts& counts,
                             Progress& progress) const {
  Lattice lattice = store_.info().levels[static_cast<std::size_t>(level)].lattice;
  lattice.type = store_.info().stored_type;
  const auto ranges = make_level_ranges(lattice);
  const auto close = [&](Index z1) {
    ranges->close(
        z1, [&](Box3 items, std::span<const std::byte> pairs) { output.put_blocks(items, pairs); },
        [&](Box3 items, std::span<const std::byte> pairs) { output.put_bricks(items, pairs); });
  };
  bool has_nan = false;
  for (std::uint32_t number = 1; number <= parts_.count(); ++number) {
    progress.advance(1);
    const BrickRun run = parts_.bricks(level, number);
    if (run.empty()) continue;
    // What the next part begins with, whichever has bricks: no sample below is still to come.
    const Index next_z =
        static_cast<Index>(run.end) < volume(lattice.bricks())
            ? point_at(static_cast<Index>(run.end), lattice.bricks()).z * lattice.brick.z
            : lattice.extent.z;
    const fs::path path = parts_.ranges_file(number);
    const auto file = PartRangesReader::open(
        path, {number, parts_.count()}, parts_.ranges_state(number), store_.info().levels, false);
    if (!file) changed_meanwhile(path);
    Index complete = 0;  // of the part, by the records so far
    for (const PartRecord& record : file->records()) {
      if (record.level != level) continue;
      if (record.z1 > complete) close(complete);
      complete = record.z1;
      put(*file, record, *ranges, output);
    }
    close(next_z);
    if (level == 0) add_counts(file->counts(), counts);
    has_nan = has_nan || file->has_nan();
  }
  return has_nan;
}

TakeIndexChunk JoinedIndexParts::chunks_of(int level, Publisher& publisher) const {
  return [this, level, &publisher](const IndexChunkName& name, const fs::path& path) {
    const auto found = chunks_.find(place_of(level, name.chunk));
    if (found == chunks_.end()) return false;
    const fs::path& from = found->second.path;
    const std::size_t count = index_layout(store_, level, options_).parts_of_chunk(name.chunk);
    File file = OutputFolder(parts_.folder()).open_file(from, O_RDWR);
    if (!file) changed_meanwhile(from);
    if (!IndexChunk::is_whole(from, count, name)) {
      if (!IndexChunk::is_whole(from, count, found->second.name)) return false;
      rename_index_chunk(file, count, found->second.name, name);
    }
    publisher.folder().make_folder(path.parent_path());
    std::error_code failure;
    fs::rename(from, path, failure);
    if (failure) throw system_error("move a part of an index to", path.string(), failure.value());
    file.set_path(path);
    publisher.sync(std::move(file));
    return true;
  };
}

}  // namespace isobrick
