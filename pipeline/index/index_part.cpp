#include "pipeline/index/index_part.h"

#include <filesystem>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/stored_index.h"
#include "core/stopwatch.h"
#include "pipeline/index/add_ranges.h"
#include "pipeline/index/index_parts.h"
#include "pipeline/index/level_index.h"
#include "pipeline/index/level_scan.h"
#include "pipeline/index/part_ranges_file.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Computes the ranges of one part.
class PartScan {
 public:
  PartScan(const StoreReader& store, const IndexParts& parts, Part part, std::uint64_t memory,
           int threads)
      : store_(store.native()), parts_(parts), part_(part), memory_(memory), threads_(threads) {}

  std::uint64_t bytes() const {
    std::uint64_t sum = 0;
    for (int level = 0; level < static_cast<int>(store_.info().levels.size()); ++level) {
      const Lattice& lattice = this->lattice(level);
      for (const Box3& bricks : parts_.boxes(level, part_.number))
        sum += static_cast<std::uint64_t>(volume(samples_of(lattice, bricks).extent())) *
               lattice.sample_bytes();
    }
    return sum;
  }

  /// Writes the file, unless it is there, of the samples as they are.
  void run(Progress& progress) {
    const auto levels = static_cast<int>(store_.info().levels.size());
    std::vector<std::uint64_t> piece_bytes;
    for (const LevelInfo& level : store_.info().levels)
      piece_bytes.push_back(
          range_piece_bytes(level, memory_, decode_extra(store_.info(), threads_), threads_));
    progress.begin("ranges", bytes());
    // Before anything is read: what changes later makes the part one of another state.
    const std::uint32_t state = parts_.ranges_state(part_.number);
    const fs::path file = parts_.ranges_file(part_.number);
    if (bytes() > 0 && !PartRangesReader::open(file, part_, state, store_.info().levels, true)) {
      fs::create_directories(file.parent_path());
      PartRangesWriter writer(file, part_, state);
      const auto counts = make_value_counts(store_.info().type);
      bool has_nan = false;
      for (int level = 0; level < levels; ++level)
        has_nan |= scan(level, piece_bytes[static_cast<std::size_t>(level)], writer,
                        level == 0 ? counts.get() : nullptr, progress);
      writer.finish(counts->counts(), has_nan);
    }
    progress.end();
  }

 private:
  const Lattice& lattice(int level) const {
    return store_.info().levels[static_cast<std::size_t>(level)].lattice;
  }
  static Box3 samples_of(const Lattice& lattice, Box3 bricks) {
    return intersect({bricks.lo * lattice.brick, bricks.hi * lattice.brick}, lattice.box());
  }
  /// Whether any sample is NaN.
  bool scan(int level, std::uint64_t piece_bytes, PartRangesWriter& writer, ValueCounts* counts,
            Progress& progress) {
    const BrickRun run = parts_.bricks(level, part_.number);
    if (run.empty()) return false;
    const Lattice& lattice = this->lattice(level);
    const auto ranges = make_part_ranges(lattice, samples_of(lattice, parts_.bounds(level, run)));
    Index z1 = 0;
    const auto put = [&](PartRecord::Kind kind) {
      return [&, kind](Box3 items, std::span<const std::byte> pairs) {
        writer.append({.kind = kind, .level = level, .items = items, .z1 = z1}, pairs);
      };
    };
    const RangeEmit blocks = put(PartRecord::Kind::blocks), bricks = put(PartRecord::Kind::bricks);
    std::vector<std::byte> buffer;
    std::vector<std::uint32_t> checksums;
    for (const Box3& box : parts_.boxes(level, part_.number)) {
      // Of the layers before.
      ranges->close(z1 = box.lo.z * lattice.brick.z, blocks, bricks);
      checksums.assign(static_cast<std::size_t>(volume(box.extent())), 0);
      scan_box(store_, level, samples_of(lattice, box), static_cast<std::size_t>(piece_bytes),
               buffer, *ranges,
               {.checksum =
                    [&](Int3 b, std::uint32_t checksum) {
                      checksums[static_cast<std::size_t>(linear_index(b - box.lo, box.extent()))] =
                          checksum;
                    },
                .counts = counts,
                .advance = [&](std::uint64_t done) { progress.advance(done); }});
      put(PartRecord::Kind::checksums)(box, std::as_bytes(std::span(checksums)));
    }
    ranges->close(z1 = lattice.extent.z, blocks, bricks);
    return ranges->has_nan();
  }

  StoreReader store_;
  const IndexParts& parts_;
  Part part_;
  std::uint64_t memory_;
  int threads_;
};

/// Makes the chunks of one part, unless they are there.
void make_chunks(const StoreReader& store, const IndexParts& parts, const IndexOptions& options,
                 IndexInput input, std::uint64_t memory, int threads, Progress& progress,
                 IndexReport& report) {
  const std::uint32_t number = options.part->number;
  const std::vector<IndexParts::Chunk> chunks = parts.chunks(number);
  const auto bricks_of = [&](const IndexParts::Chunk& chunk) {
    const IndexLayout layout = index_layout(store, chunk.level, options);
    return static_cast<std::uint64_t>(volume(layout.bricks_of_chunk(chunk.chunk).extent()));
  };
  std::uint64_t bricks = 0;
  for (const IndexParts::Chunk& chunk : chunks) bricks += bricks_of(chunk);
  report.level_bytes.resize(store.info().levels.size());
  if (chunks.empty()) return;
  fs::create_directories(parts.folder_of(number));
  Publisher publisher(parts.folder_of(number));
  progress.begin("index", bricks);
  for (const IndexParts::Chunk& chunk : chunks) {
    const IndexLayout layout = index_layout(store, chunk.level, options);
    const IndexChunkName name = parts.name_of(chunk);
    const fs::path path = parts.chunk_file(number, chunk);
    const bool kept = IndexChunk::is_whole(path, layout.parts_of_chunk(chunk.chunk), name);
    if (!kept) {
      publisher.discard_temporary(path);
      build_index_chunk(
          span_index_parts(store, chunk.level, layout, options.kind, memory, threads, input),
          layout, name, path, publisher);
    }
    ++report.chunks;
    report.chunks_kept += kept;
    progress.advance(bricks_of(chunk));
  }
  publisher.wait();
  for (const IndexParts::Chunk& chunk : chunks)
    report.level_bytes[static_cast<std::size_t>(chunk.level)] +=
        fs::file_size(parts.chunk_file(number, chunk));
  progress.end();
}

}  // namespace

IndexReport make_index_part(const StoreReader& store, const IndexOptions& options,
                            std::uint64_t memory, int threads, Progress& progress) {
  IndexOptions begun = options;  // what an interrupted join left is no obstacle
  begun.resume = true;
  bool is_there = !options.force;
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level) {
    const LevelIndex index(store, level, begun, index_layout(store, level, begun));
    index.check();
    is_there = is_there && index.is_there();
  }
  const IndexParts parts(store, options, options.part->count);
  // Parts beside an index that is there wait for the join that made it to go on.
  if (is_there && parts.has_rest()) return {};
  if (is_there)
    throw UsageError(fmt::format("'{}' has the {} index already; --force replaces it",
                                 store.info().name, name_of(options.kind)));
  IndexReport report;
  report.ranges_added = needs_ranges(store, options);
  if (report.ranges_added) {
    Stopwatch watch;
    PartScan(store, parts, *options.part, memory, threads).run(progress);
    report.range_seconds = watch.lap();
  }
  make_chunks(store, parts, options, report.ranges_added ? IndexInput::samples : IndexInput::ranges,
              memory, threads, progress, report);
  return report;
}

}  // namespace isobrick
