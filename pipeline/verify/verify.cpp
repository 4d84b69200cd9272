#include <isobrick/verify.h>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <set>
#include <unordered_set>

#include <isobrick/error.h>
#include <isobrick/store_reader.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/stored_index.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/store_names.h"
#include "core/cancellable_progress.h"
#include "core/surface_range.h"
#include "pipeline/histogram/histogram.h"
#include "pipeline/index/level_scan.h"
#include "pipeline/program_memory.h"
#include "pipeline/verify/verify_index.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxDamages = 1000;
/// Samples in memory at a time: more are no faster.
constexpr std::uint64_t kVerifiedPieceBytes = 128 * kMiB;
/// Of the lists of damages and of bricks that cannot be read.
constexpr std::uint64_t kListBytes = 8 * kMiB;
/// Beyond so many unreadable bricks, every range counts as one that covers such a brick.
constexpr std::size_t kMaxUnreadable = std::size_t{1} << 17;
/// Shards of a level that are looked for, each a file: about half a minute.
constexpr Index kMaxShards = Index{1} << 21;

/// Collects damages. A broken shard index causes the same message for each of its
/// bricks: that is one damage. Thread-safe.
class DamageList {
 public:
  void add(const std::string& line) {
    const std::lock_guard lock(mutex_);
    if (seen_.count(line) != 0) return;
    ++report_.damage_count;
    if (report_.damages.size() == kMaxDamages) return;
    seen_.insert(line);
    report_.damages.push_back(line);
  }
  VerifyReport& report() { return report_; }

 private:
  std::mutex mutex_;
  std::set<std::string> seen_;
  VerifyReport report_;
};

/// Checks the bricks of one level, and its ranges and histogram against them.
class LevelCheck {
 public:
  LevelCheck(const StoreReader& store, int level, DamageList& damages)
      : store_(store),
        level_(level),
        lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
        damages_(damages) {}

  void run(std::uint64_t piece_bytes, Progress& progress);

 private:
  void fail(Int3 brick, const std::string& what);
  void compare(bool blocks, Box3 items, std::span<const std::byte> pairs);
  void compare_histogram(const SampleCounts& counted);
  bool sees_unreadable(Int3 item, Int3 edge) const;

  const StoreReader& store_;
  int level_;
  const Lattice& lattice_;
  DamageList& damages_;
  std::mutex mutex_;
  std::unordered_set<Index> unreadable_;  ///< bricks, at most kMaxUnreadable
};

void LevelCheck::fail(Int3 brick, const std::string& what) {
  damages_.add(what);
  const std::lock_guard lock(mutex_);
  if (unreadable_.size() < kMaxUnreadable)
    unreadable_.insert(linear_index(brick, lattice_.bricks()));
}

/// Whether the item's cells touch a sample of a brick that could not be read.
bool LevelCheck::sees_unreadable(Int3 item, Int3 edge) const {
  if (unreadable_.empty()) return false;
  if (unreadable_.size() == kMaxUnreadable) return true;
  const Box3 seen =
      intersect({item * edge, (item + Int3{1, 1, 1}) * edge + Int3{1, 1, 1}}, lattice_.box());
  bool found = false;
  for_each_point(lattice_.bricks_of(seen), [&](Int3 brick) {
    found |= unreadable_.contains(linear_index(brick, lattice_.bricks()));
  });
  return found;
}

void LevelCheck::compare(bool blocks, Box3 items, std::span<const std::byte> pairs) {
  const Int3 edge = blocks ? Int3{kBlockEdge, kBlockEdge, kBlockEdge} : lattice_.brick;
  const std::string_view what = blocks ? "block" : "brick";
  // Images of others have ranges only once they were added.
  if (!store_.info().ours && !store_.has_ranges(level_)) return;
  RangeTable stored;
  try {
    stored = blocks ? store_.block_ranges(level_, items) : store_.brick_ranges(level_, items);
  } catch (const Error& e) {
    return damages_.add(fmt::format("level {}: {}", level_, e.what()));
  }
  visit_sample(lattice_.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    const auto* found = reinterpret_cast<const ValueRange<T>*>(pairs.data());
    for_each_point(items, [&](Int3 p) {
      const ValueRange<double> samples = surface_range(*found++);
      const ValueRange<double>& expected = stored.at(p);
      if (expected == samples || (expected.empty() && samples.empty()) || sees_unreadable(p, edge))
        return;
      damages_.add(fmt::format(
          "level {}, {} ({}, {}, {}): its range is [{}, {}], that of its samples [{}, {}]", level_,
          what, p.x, p.y, p.z, expected.lo, expected.hi, samples.lo, samples.hi));
    });
  });
}

void LevelCheck::compare_histogram(const SampleCounts& counted) {
  if (!unreadable_.empty()) return;
  try {
    const auto stored = stored_counts(store_);
    if (stored && *stored != counted)
      damages_.add(fmt::format("level {}: its histogram is not that of its samples", level_));
  } catch (const Error& e) {
    damages_.add(fmt::format("level {}: {}", level_, e.what()));
  }
}

void LevelCheck::run(std::uint64_t piece_bytes, Progress& progress) {
  const auto ranges = make_level_ranges(lattice_);
  const auto counts = level_ == 0 ? make_value_counts(lattice_.type) : nullptr;
  scan_level(
      store_, level_, piece_bytes, *ranges,
      [&](Box3 items, std::span<const std::byte> pairs) { compare(true, items, pairs); },
      [&](Box3 items, std::span<const std::byte> pairs) { compare(false, items, pairs); },
      {.failure = [&](Int3 brick, const std::string& what) { fail(brick, what); },
       .counts = counts.get(),
       .advance = [&](std::uint64_t done) { progress.advance(done); }});
  if (counts) compare_histogram(counts->counts());
}

/// How the samples of a level are read within a budget.
struct LevelBudget {
  int threads;
  std::uint64_t piece_bytes;
};

LevelBudget budget_of(const StoreInfo& store, int level, int threads, std::uint64_t memory) {
  const Lattice& lattice = store.levels[static_cast<std::size_t>(level)].lattice;
  const Int3 blocks = lattice.blocks(), bricks = lattice.bricks();
  // A layer of stored ranges, to compare with.
  const auto table =
      static_cast<std::uint64_t>(std::max(blocks.x * blocks.y, bricks.x * bricks.y)) *
      sizeof(ValueRange<double>);
  const auto least = [&](int n) {
    return kProgramBytes + kListBytes + slab_memory(store, level, n) + table +
           level_ranges_bytes(lattice, lattice.brick.z) + value_counts_bytes(lattice.type, n) +
           lattice.brick_bytes();
  };
  while (threads > 1 && least(threads) > memory) --threads;
  if (least(threads) > memory)
    throw UsageError(fmt::format(
        "a memory budget of {} MiB is too small: level {} has bricks of {} × {} × {} samples and "
        "needs --memory {}M at least",
        memory / kMiB, level, lattice.brick.x, lattice.brick.y, lattice.brick.z,
        least(threads) / kMiB + 1));
  return {threads, std::min(kVerifiedPieceBytes, memory - least(threads) + lattice.brick_bytes())};
}

/// Checks the bricks and ranges of a level, unless they are too many to look for.
void verify_level(const StoreReader& store, int level, int threads, std::uint64_t memory,
                  DamageList& damages, Progress& progress) {
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  const Index shards = volume(ceil_div(info.lattice.extent, info.shard));
  if (shards > kMaxShards)
    return damages.add(
        fmt::format("level {}: not looked at: of its {} chunk files at most {} are looked for",
                    level, shards, kMaxShards));
  const LevelBudget budget = budget_of(store.info(), level, threads, memory);
  Workers(budget.threads).execute([&] {
    LevelCheck(store, level, damages).run(budget.piece_bytes, progress);
  });
}

/// The groups of a store of ours, which other programs need and ours does not.
void verify_groups(const StoreReader& store, DamageList& damages) {
  if (!store.info().ours) return;
  const Storage& storage = *store.storage();
  const auto check = [&](const std::string& key, bool version2) {
    const std::string where = quoted(storage, key);
    try {
      const auto text = read_small_object(storage, key, kMaxMetadataBytes);
      if (!text) return damages.add(where + " is missing");
      const nlohmann::json parsed = parse_json(*text, where);
      const JsonReader group(parsed, where);
      if (group.at("zarr_format").integer() != (version2 ? 2 : 3) ||
          (!version2 && group.string_at("node_type") != "group"))
        damages.add(where + " is no group");
    } catch (const Error& e) {
      damages.add(e.what());
    }
  };
  if (storage.open(".zattrs")) check(".zgroup", true);
  check("isobrick/zarr.json", false);
  for (std::size_t i = 0; i < store.info().levels.size(); ++i)
    check(level_addition("", static_cast<int>(i), "zarr.json"), false);
}

/// The kinds of index of each level. That a level lacks one which another has is damage, and so is
/// what cannot be looked at.
std::vector<std::vector<std::string>> find_indexes(const StoreReader& store, DamageList& damages) {
  std::vector<std::vector<std::string>> levels(store.info().levels.size());
  std::set<std::string> all;
  bool seen = true;
  for (std::size_t level = 0; level < levels.size(); ++level) try {
      levels[level] = index_folder_kinds(store, static_cast<int>(level));
      all.insert(levels[level].begin(), levels[level].end());
    } catch (const Error& e) {
      damages.add(fmt::format("level {}: {}", level, e.what()));
      seen = false;
    }
  for (std::size_t level = 0; seen && level < levels.size(); ++level)
    for (const std::string& kind : all)
      if (std::ranges::find(levels[level], kind) == levels[level].end())
        damages.add(
            fmt::format("level {}: its {} index is gone, which another level has; {} "
                        "--kind {} --force makes it anew",
                        level, kind, index_command(store.info()), kind));
  return levels;
}

}  // namespace

VerifyReport verify(const std::filesystem::path& path, const VerifyOptions& options,
                    Progress& reported) {
  CancellableProgress progress(reported, options.cancel);
  DamageList damages;
  std::unique_ptr<StoreReader> store;
  try {
    store = std::make_unique<StoreReader>(path, options.selection);
  } catch (const DamageError& e) {
    damages.add(e.what());
    return damages.report();
  }
  const std::vector<LevelInfo>& levels = store->info().levels;
  std::uint64_t bytes = 0;
  for (const LevelInfo& level : levels) {
    damages.report().bricks += static_cast<std::uint64_t>(volume(level.lattice.bricks()));
    bytes +=
        static_cast<std::uint64_t>(volume(level.lattice.extent)) * level.lattice.sample_bytes();
  }
  progress.begin("verify", bytes);
  const int threads = Workers(options.threads).threads();
  verify_groups(*store, damages);
  const StoreReader native = store->native();
  for (std::size_t level = 0; level < levels.size(); ++level)
    verify_level(native, static_cast<int>(level), threads, options.memory, damages, progress);
  progress.end();
  std::uint64_t index_bytes = 0;
  const auto indexes = find_indexes(*store, damages);
  for (std::size_t i = 0; i < indexes.size(); ++i)
    for (const std::string& kind : indexes[i]) {
      const int level = static_cast<int>(i);
      const auto add = [&](const std::string& line) { damages.add(line); };
      index_bytes += verify_index(*store, level, kind, threads, options.memory, add, progress);
      damages.report().indexes.push_back({level, kind});
    }
  damages.report().bytes = store->bytes_read() + index_bytes;
  return damages.report();
}

}  // namespace isobrick
