#include "isobrick/pipeline/convert_sparse.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "isobrick/bricks/codec.h"
#include "isobrick/core/error.h"
#include "isobrick/core/pod_buffer.h"
#include "isobrick/io/file.h"
#include "isobrick/io/output_file.h"
#include "isobrick/pipeline/downsample.h"

namespace isobrick {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
/// Program, libraries, stacks, and the ranges of a few hundred chunks.
constexpr std::size_t kProgramBytes = 32 * kMiB;
/// Bricks that one brick of the next level is averaged from.
constexpr std::size_t kChildren = 8;

using Zyx = std::tuple<Index, Index, Index>;
Zyx zyx(Int3 p) { return {p.z, p.y, p.x}; }

/// A brick that may be something else than the fill value.
struct Item {
  Int3 brick;
  std::size_t place = 0;  ///< of its samples in the spool
};

/// The items that a brick of the next level is made of.
struct Family {
  Int3 parent;
  std::vector<Item> items;
};

Int3 parent_of(Int3 brick) { return {brick.x / 2, brick.y / 2, brick.z / 2}; }

std::vector<Family> families_of(std::vector<Item> items) {
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
    return std::pair(zyx(parent_of(a.brick)), zyx(a.brick)) <
           std::pair(zyx(parent_of(b.brick)), zyx(b.brick));
  });
  std::vector<Family> families;
  for (const Item& item : items) {
    const Int3 parent = parent_of(item.brick);
    if (families.empty() || families.back().parent != parent) families.push_back({parent, {}});
    families.back().items.push_back(item);
  }
  return families;
}

/// The bricks of level 0 that are not known to be the fill value, found by
/// halving the box of all.
class Search {
 public:
  Search(const VolumeSource& source, const Lattice& lattice) : source_(source), lattice_(lattice) {}

  std::vector<Item> run() {
    const Int3 bricks = lattice_.bricks();
    Index edge = 1;
    while (edge < std::max({bricks.x, bricks.y, bricks.z})) edge *= 2;
    visit({0, 0, 0}, edge);
    return std::move(found_);
  }

 private:
  void visit(Int3 first, Index edge) {
    const Box3 bricks =
        intersect({first, first + Int3{edge, edge, edge}}, {{0, 0, 0}, lattice_.bricks()});
    if (bricks.empty()) return;
    if (source_.is_fill(
            intersect({bricks.lo * lattice_.brick, bricks.hi * lattice_.brick}, lattice_.box())))
      return;
    if (edge == 1) {
      found_.push_back({first});
      return;
    }
    for_each_point({{0, 0, 0}, {2, 2, 2}},
                   [&](Int3 half) { visit(first + half * (edge / 2), edge / 2); });
  }

  const VolumeSource& source_;
  const Lattice& lattice_;
  std::vector<Item> found_;
};

/// Whole bricks in a temporary file, in the order in which they came.
class BrickSpool {
 public:
  BrickSpool(const std::filesystem::path& folder, std::size_t brick_bytes)
      : path_((folder / "spool").string()),
        writer_(open_scratch_beside(path_)),
        fd_(writer_.share()),
        brick_bytes_(brick_bytes) {}

  void append(Int3 brick, std::span<const std::byte> samples) {
    writer_.append(samples);
    items_.push_back({brick, items_.size()});
  }
  void finish() { writer_.flush(); }
  /// After finish(), from any thread.
  void read(std::size_t place, std::byte* out) const {
    read_at(fd_.get(), path_, place * brick_bytes_, out, brick_bytes_);
  }
  const std::vector<Item>& items() const { return items_; }

 private:
  std::string path_;
  FileWriter writer_;
  UniqueFd fd_;
  std::size_t brick_bytes_;
  std::vector<Item> items_;
};

/// Copies a box between dense arrays: its corner lies at `from_at` in one and at
/// `to_at` in the other. `from` and `to` may be the same array when `to`'s rows
/// do not lie behind `from`'s.
struct Dense {
  std::byte* samples;
  Int3 extent;
};
void copy_box(Dense from, Int3 from_at, Dense to, Int3 to_at, Int3 extent, std::size_t sample) {
  const auto row = static_cast<std::size_t>(extent.x) * sample;
  for_each_point({{0, 0, 0}, {1, extent.y, extent.z}}, [&](Int3 p) {
    std::memmove(
        to.samples + static_cast<std::size_t>(linear_index(to_at + p, to.extent)) * sample,
        from.samples + static_cast<std::size_t>(linear_index(from_at + p, from.extent)) * sample,
        row);
  });
}

/// What has become of a family.
struct Parcel {
  struct Brick {
    Int3 brick;
    std::uint32_t crc = 0;
    bool kept = false;  ///< its shard was whole already
    std::optional<std::vector<std::byte>> encoded;
    BrickBlocks ranges;
  };
  Int3 parent;
  std::vector<Brick> bricks;
  PodBuffer<std::byte> average;  ///< the parent's samples, a full brick; empty in the last level
};

std::size_t working_bytes(const StoreLayout& layout, std::size_t in_flight, int threads) {
  const std::size_t brick = layout.levels.front().lattice.brick_bytes();
  return in_flight * (kChildren + 1) * brick +
         static_cast<std::size_t>(threads) * (3 * brick + encoder_memory(layout.zstd_level, brick));
}

}  // namespace

/// One level on its way into the store.
class SparsePyramid::Level {
 public:
  Level(const StoreLayout& layout, int level, std::vector<Item> items, StoreWriter& store,
        ConvertJournal* journal, bool resumed, Progress& progress)
      : layout_(layout),
        level_(level),
        info_(layout.levels[static_cast<std::size_t>(level)]),
        store_(store),
        journal_(journal),
        progress_(progress),
        bricks_per_shard_(ceil_div(info_.shard, info_.lattice.brick)) {
    for (const Item& item : items) {
      there_.insert(zyx(item.brick));
      shards_.try_emplace(zyx(shard_of(item.brick)), false);
    }
    for (auto& [shard, whole] : shards_)
      whole = store_.shard_is_whole(level_,
                                    {std::get<2>(shard), std::get<1>(shard), std::get<0>(shard)});
    next_shard_ = shards_.cbegin();
    if (resumed) forget_other_shards();
    families_ = families_of(std::move(items));
    ranges_ = make_sparse_ranges(store_, level_, info_.lattice, layout.fill_value,
                                 [this](Int3 brick) { return there_.contains(zyx(brick)); });
  }

  /// Reads the items from `spool`, or from `source` where there is none, and
  /// leaves the next level's bricks in `next`.
  void write(VolumeSource& source, const BrickSpool* spool, BrickSpool* next, std::size_t in_flight,
             Counts& counts) {
    counts.bricks += static_cast<std::uint64_t>(volume(info_.lattice.bricks()));
    counts.absent += static_cast<std::uint64_t>(volume(info_.lattice.bricks()));
    std::size_t taken = 0;
    const auto take = [&](tbb::flow_control& flow) -> Family* {
      if (taken < families_.size()) return &families_[taken++];
      flow.stop();
      return nullptr;
    };
    Index layer = 0;
    const auto deliver = [&](const std::shared_ptr<Parcel>& parcel) {
      for (; layer < parcel->parent.z; ++layer) close(2 * (layer + 1) * info_.lattice.brick.z);
      put(*parcel, counts);
      if (next != nullptr &&
          !all_fill(info_.lattice.type, parcel->average.span(), layout_.fill_value))
        next->append(parcel->parent, parcel->average.span());
    };
    tbb::parallel_pipeline(
        in_flight, tbb::make_filter<void, Family*>(tbb::filter_mode::serial_in_order, take) &
                       tbb::make_filter<Family*, std::shared_ptr<Parcel>>(
                           tbb::filter_mode::parallel,
                           [&](Family* family) { return pack(*family, source, spool, next); }) &
                       tbb::make_filter<std::shared_ptr<Parcel>, void>(
                           tbb::filter_mode::serial_in_order, deliver));
    close(info_.lattice.extent.z);
    if (next != nullptr) next->finish();
  }

 private:
  Int3 shard_of(Int3 brick) const {
    const Int3 n = bricks_per_shard_;
    return {brick.x / n.x, brick.y / n.y, brick.z / n.z};
  }

  /// An interrupted run may have left a damaged shard where none belongs.
  void forget_other_shards() {
    for_each_point({{0, 0, 0}, ceil_div(info_.lattice.extent, info_.shard)}, [&](Int3 shard) {
      if (!shards_.contains(zyx(shard))) store_.finish_shard(level_, shard);
    });
  }

  std::shared_ptr<Parcel> pack(const Family& family, VolumeSource& source, const BrickSpool* spool,
                               const BrickSpool* next) const {
    const Lattice& lattice = info_.lattice;
    auto parcel = std::make_shared<Parcel>();
    parcel->parent = family.parent;
    if (next != nullptr) {
      parcel->average.resize(lattice.brick_bytes());
      const std::uint64_t bits = fill_bits(lattice.type, layout_.fill_value);
      for (std::size_t at = 0; at < lattice.brick_bytes(); at += lattice.sample_bytes())
        std::memcpy(parcel->average.data() + at, &bits, lattice.sample_bytes());
    }
    // A thread that waits for a part of one family must not begin another one:
    // they would share its buffers.
    tbb::this_task_arena::isolate([&] {
      for (const Item& item : family.items)
        parcel->bricks.push_back(pack_brick(item, source, spool, next ? parcel.get() : nullptr));
    });
    return parcel;
  }

  Parcel::Brick pack_brick(const Item& item, VolumeSource& source, const BrickSpool* spool,
                           Parcel* parcel) const {
    const Lattice& lattice = info_.lattice;
    const Box3 box = lattice.brick_box(item.brick);
    const std::size_t sample = lattice.sample_bytes();
    thread_local PodBuffer<std::byte> samples, whole, half;
    samples.resize(lattice.brick_bytes());
    if (spool != nullptr) {
      spool->read(item.place, samples.data());
      copy_box({samples.data(), lattice.brick}, {}, {samples.data(), box.extent()}, {},
               box.extent(), sample);
    } else {
      source.read(box, samples.data());
    }
    Parcel::Brick brick{item.brick, 0, shards_.at(zyx(shard_of(item.brick))), {}, {}};
    brick.ranges = scan_brick(lattice, box, samples.data());
    if (parcel != nullptr) {
      half.resize(lattice.brick_bytes());
      downsample(lattice.type, box.extent(), samples.data(), half.data());
      const Int3 corner = (item.brick - parent_of(item.brick) * 2) *
                          Int3{lattice.brick.x / 2, lattice.brick.y / 2, lattice.brick.z / 2};
      copy_box({half.data(), half_extent(box.extent())}, {},
               {parcel->average.data(), lattice.brick}, corner, half_extent(box.extent()), sample);
    }
    whole.resize(lattice.brick_bytes());
    copy_box({samples.data(), box.extent()}, {}, {whole.data(), lattice.brick}, {}, box.extent(),
             sample);
    pad_brick(lattice, item.brick, layout_.fill_value, whole.data());
    if (journal_ != nullptr) brick.crc = crc32c(whole.span());
    if (!brick.kept)
      brick.encoded =
          encode_brick(lattice.type, whole.span(), layout_.fill_value, layout_.zstd_level);
    return brick;
  }

  void put(const Parcel& parcel, Counts& counts) {
    for (const Parcel::Brick& brick : parcel.bricks) {
      ranges_->add(brick.ranges);
      counts.has_nan |= brick.ranges.has_nan;
      if (journal_ != nullptr) journal_->add(brick.brick, brick.crc);
      if (brick.kept)
        ++counts.kept;
      else if (brick.encoded)
        store_.put(level_, brick.brick, *brick.encoded);
      if (brick.kept || brick.encoded) --counts.absent;
      const auto samples =
          static_cast<std::uint64_t>(volume(info_.lattice.brick_box(brick.brick).extent()));
      progress_.advance(level_ == 0 ? samples * info_.lattice.sample_bytes() : 0);
    }
  }

  /// All bricks below z1 were put.
  void close(Index z1) {
    // Before anything is finished: a resume takes that as this input's.
    if (journal_ != nullptr) journal_->close(z1);
    ranges_->close(z1);
    const bool all = z1 >= info_.lattice.extent.z;
    for (; next_shard_ != shards_.end(); ++next_shard_) {
      const auto [z, y, x] = next_shard_->first;
      if (!all && (z + 1) * info_.shard.z > z1) break;
      if (!next_shard_->second) store_.finish_shard(level_, {x, y, z});
    }
  }

  const StoreLayout& layout_;
  int level_;
  const LevelInfo& info_;
  StoreWriter& store_;
  ConvertJournal* journal_;
  Progress& progress_;
  Int3 bricks_per_shard_;
  std::set<Zyx> there_;
  std::map<Zyx, bool> shards_;  ///< with bricks; whether an interrupted run finished it
  std::map<Zyx, bool>::const_iterator next_shard_;
  std::vector<Family> families_;
  std::unique_ptr<SparseRanges> ranges_;
};

bool SparsePyramid::possible(const VolumeSource& source, const StoreLayout& layout) {
  return source.sparse() && source.parallel() &&
         sparse_ranges_possible(layout.levels.front().lattice);
}

SparsePyramid::SparsePyramid(VolumeSource& source, const StoreLayout& layout,
                             const ConvertOptions& options, int threads)
    : source_(source),
      layout_(layout),
      threads_(threads),
      in_flight_(static_cast<std::size_t>(threads) + 1) {
  const std::size_t fixed = kProgramBytes + source.memory();
  while (in_flight_ > 1 && fixed + working_bytes(layout, in_flight_, threads_) > options.memory) {
    --in_flight_;
    threads_ = std::min(threads_, static_cast<int>(in_flight_));
  }
  if (const std::size_t least = fixed + working_bytes(layout, in_flight_, threads_);
      options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {} MiB is too small: {} MiB are needed at least, {} of them "
        "for the grid",
        options.memory / kMiB, least / kMiB + 1, source.memory() / kMiB + 1));
}

SparsePyramid::Counts SparsePyramid::write(StoreWriter& store, ConvertJournal& journal,
                                           const std::filesystem::path& folder, bool resumed,
                                           Progress& progress) {
  Counts counts;
  const auto levels = static_cast<int>(layout_.levels.size());
  const Lattice& finest = layout_.levels.front().lattice;
  std::vector<Item> items = Search(source_, finest).run();
  std::uint64_t bytes = 0;
  for (const Item& item : items)
    bytes += static_cast<std::uint64_t>(volume(finest.brick_box(item.brick).extent())) *
             finest.sample_bytes();
  progress.begin("convert", bytes);
  std::unique_ptr<BrickSpool> spool, next;
  for (int level = 0; level < levels; ++level) {
    if (level + 1 < levels) next = std::make_unique<BrickSpool>(folder, finest.brick_bytes());
    Level(layout_, level, std::move(items), store, level == 0 ? &journal : nullptr, resumed,
          progress)
        .write(source_, spool.get(), next.get(), in_flight_, counts);
    spool = std::move(next);
    items = spool ? spool->items() : std::vector<Item>{};
  }
  progress.end();
  counts.has_nan |= layout_.fill_value != layout_.fill_value;
  return counts;
}

}  // namespace isobrick
