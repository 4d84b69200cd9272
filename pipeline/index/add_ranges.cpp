#include "pipeline/index/add_ranges.h"

#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>

#include <isobrick/error.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/range_array.h"
#include "bricks/storage/open_storage.h"
#include "bricks/store_entries.h"
#include "io/bytes/exchange.h"
#include "io/bytes/output_folder.h"
#include "pipeline/index/level_scan.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kEnoughForAPiece = std::uint64_t{256} << 20;

fs::path partial(fs::path folder) {
  folder += ".partial";
  return folder;
}

/// Below which folder ranges are added to a store.
fs::path additions_of(const StoreReader& store) {
  return store.storage()->local_path() / store.info().additions;
}

/// Calls f(folder, where it lies in a store) for the arrays of ranges and checksums of every level
/// and for the histogram.
template <class F>
void for_each_added_folder(const StoreReader& store, F&& f) {
  const fs::path root = additions_of(store);
  const auto call = [&](const std::string& place) { f(root / place, fs::path(place)); };
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level) {
    call(block_range_folder("", level));
    call(brick_range_folder("", level));
    call(brick_checksum_folder("", level));
  }
  call(histogram_folder(""));
}

/// Removes what was written beside the places of ranges.
void discard_unfinished(const StoreReader& store) {
  const OutputFolder root(store.storage()->local_path());
  for_each_added_folder(store, [&](const fs::path& folder, const fs::path&) {
    std::error_code none;
    if (fs::exists(fs::symlink_status(partial(folder), none))) root.remove_folder(partial(folder));
  });
}

}  // namespace

LevelRangeOutput::LevelRangeOutput(const StoreReader& store, int level, Publisher& publisher)
    : LevelRangeOutput(store.info().levels[static_cast<std::size_t>(level)].lattice,
                       additions_of(store), level, publisher) {}

LevelRangeOutput::LevelRangeOutput(const Lattice& lattice, const fs::path& root, int level,
                                   Publisher& publisher)
    : type_(lattice.type),
      blocks_(partial(root / block_range_folder("", level)), lattice.blocks(),
              range_array_metadata(lattice.blocks(), lattice.type), publisher),
      bricks_(partial(root / brick_range_folder("", level)), lattice.bricks(),
              range_array_metadata(lattice.bricks(), lattice.type), publisher),
      checksums_(partial(root / brick_checksum_folder("", level)), lattice.bricks(),
                 checksum_array_metadata(lattice.bricks()), publisher) {}

void LevelRangeOutput::put(ItemArrayWriter& to, Box3 items, std::span<const std::byte> pairs) {
  std::vector<std::byte> room;
  to.put(items, stored_pairs(type_, pairs, room));
}

RangeChecksums LevelRangeOutput::finish() {
  return {
      .bricks = *bricks_.finish(), .blocks = *blocks_.finish(), .content = *checksums_.finish()};
}

void replace_ranges(const StoreReader& store, const FillRanges& fill, ValueCounts& counts) {
  Publisher publisher(store.storage()->local_path());
  const StoreEntries entries = StoreEntries::of(store.info().levels);
  for_each_added_folder(store, [&](const fs::path& folder, const fs::path& place) {
    check_replaceable(folder, entries, place);
    check_replaceable(partial(folder), entries, place);
    publisher.folder().remove_folder(partial(folder));  // of a run that was interrupted
  });
  StoredRanges stored{
      .may_have_nan = false, .image_crc32c = store.info().metadata_crc32c, .levels = {}};
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level) {
    LevelRangeOutput output(store, level, publisher);
    stored.may_have_nan |= fill(level, output);
    stored.levels.push_back(output.finish());
  }
  stored.histogram = write_histogram(partial(additions_of(store) / histogram_folder("")),
                                     counts.counts(), publisher);
  publisher.wait();
  for_each_added_folder(store, [&](const fs::path& folder, const fs::path& place) {
    publisher.folder().replace_folder(partial(folder), folder);
    check_replaceable(set_aside_name(folder), entries, place);
    publisher.folder().remove_folder(set_aside_name(folder));  // what a kill may have left
  });
  publisher.write(additions_of(store) / ranges_file(""), to_json(stored));
  publisher.wait();
}

std::uint64_t range_piece_bytes(const LevelInfo& level, std::uint64_t memory, std::uint64_t others,
                                int threads) {
  const Lattice& lattice = level.lattice;
  const std::uint64_t brick = lattice.brick_bytes();
  // A brick being decoded: itself and its encoded bytes, once a thread.
  const std::uint64_t fixed =
      kProgramBytes + level.index_bytes + static_cast<std::uint64_t>(threads) * brick * 9 / 4 +
      level_ranges_bytes(lattice, lattice.brick.z) + gathered_ranges_bytes(lattice) +
      brick_checksum_bytes(level) + value_counts_bytes(lattice.type, threads);
  if (memory < fixed + brick)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: computing the ranges needs at least --memory "
        "{}M, {:.1f} MiB of it for the program and its libraries, the rest for bricks of {} × {} × "
        "{} samples, decoded on {} threads, and their ranges",
        in_mib(memory + others), mib_above(fixed + brick + others), in_mib(kProgramBytes),
        lattice.brick.x, lattice.brick.y, lattice.brick.z, threads));
  return std::min(memory - fixed, kEnoughForAPiece);
}

void add_ranges(const StoreReader& reader, std::uint64_t memory, int threads, Progress& progress) {
  const StoreReader store = reader.native();
  const StoreInfo& info = store.info();
  const std::uint64_t others = decode_extra(info, threads);
  std::vector<std::uint64_t> piece_bytes;
  std::uint64_t total = 0;
  for (const LevelInfo& level : info.levels) {
    piece_bytes.push_back(range_piece_bytes(level, memory, others, threads));
    total +=
        static_cast<std::uint64_t>(volume(level.lattice.extent)) * level.lattice.sample_bytes();
  }
  const auto counts = make_value_counts(info.type);
  progress.begin("ranges", total);
  replace_ranges(
      store,
      [&](int level, LevelRangeOutput& output) {
        const auto at = static_cast<std::size_t>(level);
        const auto ranges = make_level_ranges(info.levels[at].lattice);
        scan_level(
            store, level, static_cast<std::size_t>(piece_bytes[at]), *ranges,
            [&](Box3 items, std::span<const std::byte> pairs) { output.put_blocks(items, pairs); },
            [&](Box3 items, std::span<const std::byte> pairs) { output.put_bricks(items, pairs); },
            {.checksum =
                 [&](Int3 b, std::uint32_t checksum) {
                   output.put_checksums({b, b + Int3{1, 1, 1}}, std::span(&checksum, 1));
                 },
             .counts = level == 0 ? counts.get() : nullptr,
             .advance = [&](std::uint64_t done) { progress.advance(done); }});
        return ranges->has_nan();
      },
      *counts);
  progress.end();
}

void check_can_add(const fs::path& store) {
  if (is_zip(store))
    throw UsageError(fmt::format(
        "'{}' is a zip, which cannot be changed: unpack it, and name the folder", store.string()));
}

UniqueFd lock_store(const fs::path& store) {
  check_can_add(store);
  UniqueFd lock = OutputFolder(store).make_folder(store / "isobrick");
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw Error(fmt::format("another process is adding to '{}'", store.string()));
  return lock;
}

bool has_all_ranges(const StoreReader& store) {
  for (std::size_t level = 0; level < store.info().levels.size(); ++level)
    if (!store.has_ranges(static_cast<int>(level))) return false;
  return true;
}

void add_missing_ranges(const fs::path& path, const Selection& volume, std::uint64_t memory,
                        int threads, Progress& progress) {
  Workers workers(threads);
  workers.execute([&] {
    const UniqueFd lock = lock_store(path);
    const StoreReader store(path, volume);
    if (has_all_ranges(store)) return;
    const std::uint64_t others = decode_extra(store.info(), workers.threads());
    try {
      add_ranges(store, memory - std::min(memory, others), workers.threads(), progress);
    } catch (...) {
      discard_unfinished(store);
      throw;
    }
  });
}

}  // namespace isobrick
