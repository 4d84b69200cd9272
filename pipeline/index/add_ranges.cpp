#include "pipeline/index/add_ranges.h"

#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>

#include <isobrick/error.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/item_array.h"
#include "bricks/ranges/range_array.h"
#include "bricks/ranges/stored_ranges.h"
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

/// Bytes for the samples of a piece: what the budget leaves.
/// `others` go for what decoding takes beyond bricks; the caller has taken them off.
std::uint64_t piece_bytes(const LevelInfo& level, std::uint64_t memory, std::uint64_t others,
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

/// Writes the arrays of a level beside their places, and their checksums into `stored`. With level
/// 0 goes the histogram.
void write_ranges(const StoreReader& store, int level, std::uint64_t bytes, Publisher& publisher,
                  Progress& progress, StoredRanges& stored) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const fs::path root = additions_of(store);
  const Int3 block_count = lattice.blocks(), brick_count = lattice.bricks();
  ItemArrayWriter blocks(partial(root / block_range_folder("", level)), block_count,
                         range_array_metadata(block_count, lattice.type), publisher);
  ItemArrayWriter bricks(partial(root / brick_range_folder("", level)), brick_count,
                         range_array_metadata(brick_count, lattice.type), publisher);
  ItemArrayWriter checksums(partial(root / brick_checksum_folder("", level)), brick_count,
                            checksum_array_metadata(brick_count), publisher);
  const auto ranges = make_level_ranges(lattice);
  const auto counts = level == 0 ? make_value_counts(lattice.type) : nullptr;
  scan_level(
      store, level, static_cast<std::size_t>(bytes), *ranges, nullptr,
      [&](Box3 items, std::span<const std::byte> pairs) { blocks.put(items, pairs); },
      [&](Box3 items, std::span<const std::byte> pairs) { bricks.put(items, pairs); },
      [&](std::uint64_t done) { progress.advance(done); },
      [&](Int3 b, std::uint32_t checksum) {
        checksums.put({b, b + Int3{1, 1, 1}}, std::as_bytes(std::span(&checksum, 1)));
      },
      counts.get());
  stored.levels.push_back(
      {.bricks = *bricks.finish(), .blocks = *blocks.finish(), .content = *checksums.finish()});
  stored.may_have_nan |= ranges->has_nan();
  if (counts)
    stored.histogram =
        write_histogram(partial(root / histogram_folder("")), counts->counts(), publisher);
}

}  // namespace

void add_ranges(const StoreReader& store, std::uint64_t memory, int threads, Progress& progress) {
  const StoreInfo& info = store.info();
  const auto levels = static_cast<int>(info.levels.size());
  const std::uint64_t others = decode_extra(info, threads);
  std::uint64_t total = 0;
  for (const LevelInfo& level : info.levels) {
    piece_bytes(level, memory, others, threads);
    total +=
        static_cast<std::uint64_t>(volume(level.lattice.extent)) * level.lattice.sample_bytes();
  }
  Publisher publisher(store.storage()->local_path());
  const StoreEntries entries = StoreEntries::of(info.levels);
  for_each_added_folder(store, [&](const fs::path& folder, const fs::path& place) {
    check_replaceable(folder, entries, place);
    check_replaceable(partial(folder), entries, place);
    publisher.folder().remove_folder(partial(folder));  // of a run that was interrupted
  });
  progress.begin("ranges", total);
  StoredRanges stored{.may_have_nan = false, .image_crc32c = info.metadata_crc32c, .levels = {}};
  for (int level = 0; level < levels; ++level)
    write_ranges(store, level,
                 piece_bytes(info.levels[static_cast<std::size_t>(level)], memory, others, threads),
                 publisher, progress, stored);
  publisher.wait();
  progress.end();
  for_each_added_folder(store, [&](const fs::path& folder, const fs::path& place) {
    publisher.folder().replace_folder(partial(folder), folder);
    check_replaceable(set_aside_name(folder), entries, place);
    publisher.folder().remove_folder(set_aside_name(folder));  // what a kill may have left
  });
  publisher.write(additions_of(store) / ranges_file(""), to_json(stored));
  publisher.wait();
}

UniqueFd lock_store(const fs::path& store) {
  if (is_zip(store))
    throw UsageError(fmt::format(
        "'{}' is a zip, which cannot be changed: unpack it, and name the folder", store.string()));
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
