#include "isobrick/pipeline/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <set>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/bricks/stored_index.h"
#include "isobrick/core/error.h"
#include "isobrick/pipeline/level_scan.h"
#include "isobrick/pipeline/verify_index.h"
#include "isobrick/pipeline/workers.h"

namespace isobrick {
namespace {

constexpr std::size_t kMaxDamages = 1000;
/// Samples in memory at a time.
constexpr std::size_t kPieceBytes = std::size_t{128} << 20;

/// Collects damages. A broken shard index says the same for each of its
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

/// Checks the bricks of one level, and its ranges against them.
class LevelCheck {
 public:
  LevelCheck(const StoreReader& store, int level, DamageList& damages)
      : store_(store),
        level_(level),
        lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
        damages_(damages),
        unreadable_(static_cast<std::size_t>(volume(lattice_.bricks()))) {}

  void run(Progress& progress);

 private:
  void fail(Int3 brick, const std::string& what);
  void compare(bool blocks, Box3 items, std::span<const std::byte> pairs);
  bool sees_unreadable(Int3 item, Int3 edge) const;

  const StoreReader& store_;
  int level_;
  const Lattice& lattice_;
  DamageList& damages_;
  std::mutex mutex_;
  std::vector<bool> unreadable_;  ///< bricks
  bool any_unreadable_ = false;
};

void LevelCheck::fail(Int3 brick, const std::string& what) {
  damages_.add(what);
  const std::lock_guard lock(mutex_);
  unreadable_[static_cast<std::size_t>(linear_index(brick, lattice_.bricks()))] = true;
  any_unreadable_ = true;
}

/// Whether the item's cells touch a sample of a brick that could not be read.
bool LevelCheck::sees_unreadable(Int3 item, Int3 edge) const {
  if (!any_unreadable_) return false;
  const Box3 seen =
      intersect({item * edge, (item + Int3{1, 1, 1}) * edge + Int3{1, 1, 1}}, lattice_.box());
  bool found = false;
  for_each_point(lattice_.bricks_of(seen), [&](Int3 brick) {
    found |= unreadable_[static_cast<std::size_t>(linear_index(brick, lattice_.bricks()))];
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
  visit_scalar(lattice_.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    const auto* found = reinterpret_cast<const ValueRange<T>*>(pairs.data());
    for_each_point(items, [&](Int3 p) {
      const ValueRange<T> range = *found++;
      const ValueRange<double> samples =
          range.empty()
              ? ValueRange<double>{}
              : ValueRange<double>{static_cast<double>(range.lo), static_cast<double>(range.hi)};
      const ValueRange<double>& said = stored.at(p);
      if (said == samples || (said.empty() && samples.empty()) || sees_unreadable(p, edge)) return;
      damages_.add(
          fmt::format("level {}, {} ({}, {}, {}): its range says [{}, {}], its samples [{}, {}]",
                      level_, what, p.x, p.y, p.z, said.lo, said.hi, samples.lo, samples.hi));
    });
  });
}

void LevelCheck::run(Progress& progress) {
  const auto ranges = make_level_ranges(lattice_);
  scan_level(
      store_, level_, kPieceBytes, *ranges,
      [&](Int3 brick, const std::string& what) { fail(brick, what); },
      [&](Box3 items, std::span<const std::byte> pairs) { compare(true, items, pairs); },
      [&](Box3 items, std::span<const std::byte> pairs) { compare(false, items, pairs); },
      [&](std::uint64_t done) { progress.advance(done); });
}

}  // namespace

VerifyReport verify(const std::filesystem::path& path, int threads, Progress& progress,
                    const Selection& selection) {
  DamageList damages;
  std::unique_ptr<StoreReader> store;
  try {
    store = std::make_unique<StoreReader>(path, selection);
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
  Workers workers(threads);
  for (std::size_t level = 0; level < levels.size(); ++level)
    workers.execute([&] { LevelCheck(*store, static_cast<int>(level), damages).run(progress); });
  progress.end();
  std::uint64_t index_bytes = 0;
  for (int level = 0; level < static_cast<int>(levels.size()); ++level)
    for (const std::string& kind : stored_index_kinds(store->info().additions, level)) {
      const auto add = [&](const std::string& line) { damages.add(line); };
      index_bytes += workers.execute(
          [&] { return verify_index(*store, level, kind, workers.threads(), add, progress); });
      damages.report().indexes.push_back({level, kind});
    }
  damages.report().bytes = store->bytes_read() + index_bytes;
  return damages.report();
}

}  // namespace isobrick
