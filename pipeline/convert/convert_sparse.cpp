#include "pipeline/convert/convert_sparse.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/zarr/codec.h"
#include "core/copy_box.h"
#include "io/bytes/file.h"
#include "io/bytes/output_file.h"
#include "pipeline/convert/brick_output.h"
#include "pipeline/convert/downsample.h"
#include "pipeline/in_order.h"
#include "pipeline/program_memory.h"

namespace isobrick::inline v0 {
namespace {

/// Bricks that one brick of the next level is made of, at most.
constexpr std::size_t kChildren = 8;
/// What is kept of each brick while it waits: its place, its parent's, and its shard's.
constexpr std::size_t kBytesPerBrick = 3 * sizeof(SparseBrick);

/// Whole bricks in a temporary file, in the order in which they came.
class BrickSpool {
 public:
  /// For at most so many bricks.
  BrickSpool(const std::filesystem::path& folder, std::size_t brick_bytes, std::size_t bricks)
      : writer_(open_scratch_beside((folder / "spool").string())),
        file_(writer_.share()),
        brick_bytes_(brick_bytes) {
    bricks_.reserve(bricks);
  }

  void append(Int3 brick, std::span<const std::byte> samples) {
    writer_.append(samples);
    bricks_.push_back({brick, bricks_.size()});
  }
  void finish() { writer_.flush(); }
  /// After finish(), from any thread.
  void read(std::size_t place, std::byte* out) const {
    file_.read_at(place * brick_bytes_, {out, brick_bytes_});
  }
  /// Leaves none. `factors`: from their level to the next one.
  SparseBricks take_bricks(Int3 factors) { return {std::move(bricks_), factors}; }

 private:
  FileWriter writer_;
  File file_;
  std::size_t brick_bytes_;
  std::vector<SparseBrick> bricks_;
};

/// A family, and what has become of it.
struct PackedFamily {
  struct Brick {
    PackedBrick packed;
    BrickBlocks ranges;
  };
  std::span<const SparseBrick> family;
  Int3 parent;
  std::vector<Brick> bricks;
  PodBuffer<std::byte> coarser;  ///< the parent's samples, a full brick; empty in the last level
};

/// From a level to the next; of the last one, which has none, any do.
Int3 factors_of(const StoreLayout& layout, std::size_t level) {
  return level < layout.factors.size() ? layout.factors[level] : kHalveAll;
}

std::size_t working_bytes(const StoreLayout& layout, std::size_t in_flight, int threads) {
  const std::size_t brick = layout.levels.front().lattice.brick_bytes();
  return in_flight * (kChildren + 1) * brick +
         static_cast<std::size_t>(threads) * (3 * brick + encoder_memory(layout.codecs(), brick));
}

/// The most that the ranges of any level take.
std::size_t ranges_bytes(const StoreLayout& layout, const SparseBricks& finest, int threads) {
  std::vector<Int3> bricks;
  bricks.reserve(finest.all().size());
  for (const SparseBrick& b : finest.all()) bricks.push_back(b.brick);
  std::size_t most = 0;
  for (std::size_t i = 0; i < layout.levels.size(); ++i) {
    most = std::max(most, sparse_ranges_bytes(layout.levels[i], bricks, threads));
    for (Int3& b : bricks) b = floor_div(b, factors_of(layout, i));
    bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  }
  return most;
}

}  // namespace

/// One level on its way into the store.
class SparsePyramid::Level {
 public:
  Level(const StoreLayout& layout, int level, SparseBricks bricks, StoreWriter& store,
        ConvertJournal* journal, ValueCounts* histogram, bool resumed, Progress& progress)
      : layout_(layout),
        level_(level),
        info_(layout.levels[static_cast<std::size_t>(level)]),
        store_(store),
        journal_(journal),
        bricks_per_shard_(ceil_div(info_.shard, info_.lattice.brick)),
        factors_(factors_of(layout, static_cast<std::size_t>(level))),
        bricks_(std::move(bricks)),
        output_(store, layout, level, journal, histogram, progress) {
    find_shards();
    if (resumed) forget_other_shards();
    ranges_ = make_sparse_ranges(store_, level_, info_.lattice, layout.fill_value,
                                 [this](Int3 brick) { return bricks_.contains(brick); });
    output_.skip(static_cast<std::uint64_t>(volume(info_.lattice.bricks())) - bricks_.all().size());
    if (histogram != nullptr) histogram->add(layout.fill_value, absent_samples());
  }

  std::size_t families() const { return bricks_.families(); }
  const BrickCounts& counts() const { return output_.counts(); }
  bool has_nan() const { return has_nan_; }

  /// Reads the bricks from `spool`, or from `source` where there is none, and
  /// leaves the next level's bricks in `next`.
  void write(VolumeSource& source, const BrickSpool* spool, BrickSpool* next,
             std::size_t in_flight) {
    std::size_t taken = 0;
    const auto take = [&](PackedFamily& parcel) {
      parcel.family = bricks_.family_at(taken);
      taken += parcel.family.size();
      return !parcel.family.empty();
    };
    Index layer = 0;
    const auto deliver = [&](const PackedFamily& parcel) {
      for (; layer < parcel.parent.z; ++layer)
        close((layer + 1) * factors_.z * info_.lattice.brick.z);
      put(parcel);
      if (next != nullptr &&
          !all_fill(info_.lattice.type, parcel.coarser.span(), layout_.fill_value))
        next->append(parcel.parent, parcel.coarser.span());
    };
    run_in_order<PackedFamily>(
        in_flight, take, [&](PackedFamily& parcel) { pack(parcel, source, spool, next); }, deliver);
    close(info_.lattice.extent.z);
    if (next != nullptr) next->finish();
  }

 private:
  /// Those of bricks that are not there.
  std::uint64_t absent_samples() const {
    const Lattice& lattice = info_.lattice;
    auto samples = static_cast<std::uint64_t>(volume(lattice.extent));
    for (const SparseBrick& b : bricks_.all())
      samples -= static_cast<std::uint64_t>(volume(lattice.brick_box(b.brick).extent()));
    return samples;
  }

  /// A shard with bricks.
  struct Shard {
    Int3 place;
    bool whole = false;  ///< an interrupted run finished it
  };

  static bool is_before(Int3 a, Int3 b) {
    return std::tuple(a.z, a.y, a.x) < std::tuple(b.z, b.y, b.x);
  }

  /// The place in shards_ of a shard, or where it belongs.
  std::vector<Shard>::const_iterator shard_at(Int3 place) const {
    return std::lower_bound(shards_.begin(), shards_.end(), place,
                            [](const Shard& a, Int3 b) { return is_before(a.place, b); });
  }

  void find_shards() {
    // A shard's bricks come in several runs.
    const auto for_each_run = [this](const auto& f) {
      std::optional<Int3> last;
      for (const SparseBrick& b : bricks_.all())
        if (const Int3 place = floor_div(b.brick, bricks_per_shard_); last != place)
          f(*(last = place));
    };
    std::size_t runs = 0;
    for_each_run([&](Int3) { ++runs; });
    shards_.reserve(runs);
    for_each_run([&](Int3 place) { shards_.push_back({place}); });
    std::sort(shards_.begin(), shards_.end(),
              [](const Shard& a, const Shard& b) { return is_before(a.place, b.place); });
    const auto same = [](const Shard& a, const Shard& b) { return a.place == b.place; };
    shards_.erase(std::unique(shards_.begin(), shards_.end(), same), shards_.end());
    for (Shard& shard : shards_) shard.whole = store_.shard_is_whole(level_, shard.place);
  }

  /// An interrupted run may have left a damaged shard where none belongs.
  void forget_other_shards() {
    for_each_point({{0, 0, 0}, ceil_div(info_.lattice.extent, info_.shard)}, [&](Int3 place) {
      const auto at = shard_at(place);
      if (at == shards_.end() || at->place != place) store_.forget_shard(level_, place);
    });
  }

  void pack(PackedFamily& parcel, VolumeSource& source, const BrickSpool* spool,
            const BrickSpool* next) {
    const Lattice& lattice = info_.lattice;
    parcel.parent = bricks_.parent_of(parcel.family.front().brick);
    if (next != nullptr) {
      parcel.coarser.resize(lattice.brick_bytes());
      const Box3 whole = lattice.full_brick_box(parcel.parent);
      fill_box(lattice.type, layout_.fill_value, {parcel.coarser.data(), whole}, whole);
    }
    // A thread that waits for a part of one family must not begin another one:
    // they would share its buffers.
    tbb::this_task_arena::isolate([&] {
      for (const SparseBrick& brick : parcel.family)
        parcel.bricks.push_back(pack_brick(brick, source, spool, next ? &parcel : nullptr));
    });
  }

  PackedFamily::Brick pack_brick(const SparseBrick& item, VolumeSource& source,
                                 const BrickSpool* spool, PackedFamily* parcel) {
    const Lattice& lattice = info_.lattice;
    const Box3 box = lattice.brick_box(item.brick);
    const bool kept = shard_at(floor_div(item.brick, bricks_per_shard_))->whole;
    // Padding at the volume's border is of another value.
    if (spool == nullptr && box == lattice.full_brick_box(item.brick))
      if (const auto bits = source.constant(box))
        return pack_constant(item.brick, *bits, kept, parcel);
    const std::size_t sample = lattice.sample_bytes();
    thread_local PodBuffer<std::byte> samples, coarser;
    samples.resize(lattice.brick_bytes());
    if (spool != nullptr) {
      spool->read(item.place, samples.data());
      copy_box({samples.data(), lattice.full_brick_box(item.brick)}, {samples.data(), box}, box,
               sample);
    } else {
      source.read(box, samples.data());
    }
    PackedFamily::Brick brick;
    brick.ranges = scan_brick(lattice, box, samples.data());
    if (parcel != nullptr) {
      coarser.resize(lattice.brick_bytes());
      downsample(layout_.downsampling, lattice.type, box.extent(), factors_, samples.data(),
                 coarser.data());
      const Box3 part = coarser_box(box);
      copy_box({coarser.data(), part},
               {parcel->coarser.data(), lattice.full_brick_box(parcel->parent)}, part, sample);
    }
    brick.packed = output_.pack(item.brick, box, samples.data(), kept);
    return brick;
  }

  Box3 coarser_box(Box3 box) const {
    return {coarser_extent(box.lo, factors_), coarser_extent(box.hi, factors_)};
  }

  /// A full brick of one value, which is that of the coarser level, too.
  PackedFamily::Brick pack_constant(Int3 place, std::uint64_t bits, bool kept,
                                    PackedFamily* parcel) {
    const Lattice& lattice = info_.lattice;
    const Box3 box = lattice.brick_box(place);
    if (parcel != nullptr)
      set_box(lattice.type, bits, {parcel->coarser.data(), lattice.full_brick_box(parcel->parent)},
              coarser_box(box));
    return {output_.pack_constant(place, bits, kept), constant_brick(lattice, box, bits)};
  }

  void put(const PackedFamily& parcel) {
    for (const PackedFamily::Brick& brick : parcel.bricks) {
      ranges_->add(brick.ranges);
      has_nan_ |= brick.ranges.has_nan;
      output_.deliver(brick.packed);
    }
  }

  /// All bricks below z1 were put.
  void close(Index z1) {
    // Before anything is finished: a resume takes that as this input's.
    if (journal_ != nullptr) journal_->close(z1);
    ranges_->close(z1);
    const bool all = z1 >= info_.lattice.extent.z;
    for (; next_shard_ < shards_.size(); ++next_shard_) {
      const Shard& shard = shards_[next_shard_];
      if (!all && (shard.place.z + 1) * info_.shard.z > z1) break;
      if (shard.whole)
        store_.keep_shard(level_, shard.place);
      else
        store_.finish_shard(level_, shard.place);
    }
    const Index shards = all ? ceil_div(info_.lattice.extent, info_.shard).z : z1 / info_.shard.z;
    store_.finish_below(level_, shards * bricks_per_shard_.z);
  }

  const StoreLayout& layout_;
  int level_;
  const LevelInfo& info_;
  StoreWriter& store_;
  ConvertJournal* journal_;
  Int3 bricks_per_shard_;
  Int3 factors_;
  SparseBricks bricks_;
  BrickOutput output_;
  std::vector<Shard> shards_;  ///< in the order z, y, x
  std::size_t next_shard_ = 0;
  std::unique_ptr<SparseRanges> ranges_;
  bool has_nan_ = false;
};

bool SparsePyramid::possible(const VolumeSource& source, const StoreLayout& layout) {
  return source.sparse() && source.parallel() &&
         sparse_ranges_possible(layout.levels.front().lattice);
}

SparsePyramid::SparsePyramid(VolumeSource& source, const StoreLayout& layout,
                             const ConvertOptions& options, int threads, std::uint64_t index_memory)
    : source_(source),
      layout_(layout),
      threads_(threads),
      in_flight_(2 * static_cast<std::size_t>(threads)) {
  const Lattice& finest = layout.levels.front().lattice;
  const std::size_t count = count_sparse_bricks(source, finest);
  const std::size_t fixed = kProgramBytes + source.memory() + count * kBytesPerBrick +
                            value_counts_bytes(finest.type, threads);
  const auto refuse = [&](std::size_t all_fixed) {
    const std::size_t least = all_fixed + working_bytes(layout, in_flight_, threads_);
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {} MiB of it "
        "for the program and its libraries, {:.1f} for the grid",
        in_mib(options.memory), mib_above(std::max<std::uint64_t>(least, index_memory)),
        kProgramBytes / kMiB, in_mib(source.memory())));
  };
  const bool fits = fit(fixed, options.memory);
  // The list is short enough to be made for a message that names what is needed.
  if (!fits && count * kBytesPerBrick > kProgramBytes / 4) refuse(fixed);
  bricks_ = SparseBricks(find_sparse_bricks(source, finest, count), factors_of(layout, 0));
  const std::size_t ranges = ranges_bytes(layout, bricks_, threads_);
  if (!fits || !fit(fixed + ranges, options.memory)) refuse(fixed + ranges);
}

bool SparsePyramid::fit(std::size_t fixed, std::uint64_t memory) {
  while (in_flight_ > 1 && fixed + working_bytes(layout_, in_flight_, threads_) > memory) {
    --in_flight_;
    threads_ = std::min(threads_, static_cast<int>(in_flight_));
  }
  return fixed + working_bytes(layout_, in_flight_, threads_) <= memory;
}

SparsePyramid::Counts SparsePyramid::write(StoreWriter& store, ConvertJournal& journal,
                                           ValueCounts& histogram,
                                           const std::filesystem::path& folder, bool resumed,
                                           Progress& progress) {
  Counts counts;
  const auto levels = static_cast<int>(layout_.levels.size());
  const Lattice& finest = layout_.levels.front().lattice;
  std::uint64_t bytes = 0;
  for (const SparseBrick& b : bricks_.all())
    bytes += static_cast<std::uint64_t>(volume(finest.brick_box(b.brick).extent())) *
             finest.sample_bytes();
  progress.begin("convert", bytes);
  std::unique_ptr<BrickSpool> spool, next;
  for (int i = 0; i < levels; ++i) {
    const Int3 factors = factors_of(layout_, static_cast<std::size_t>(i));
    Level level(layout_, i, spool ? spool->take_bricks(factors) : std::move(bricks_), store,
                i == 0 ? &journal : nullptr, i == 0 ? &histogram : nullptr, resumed, progress);
    if (i + 1 < levels)
      next = std::make_unique<BrickSpool>(folder, finest.brick_bytes(), level.families());
    level.write(source_, spool.get(), next.get(), in_flight_);
    counts.bricks += level.counts().bricks;
    counts.absent += level.counts().absent;
    counts.kept += level.counts().kept;
    counts.has_nan |= level.has_nan();
    spool = std::move(next);
  }
  progress.end();
  counts.has_nan |= layout_.fill_value != layout_.fill_value;
  return counts;
}

}  // namespace isobrick
