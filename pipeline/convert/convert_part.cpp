#include "pipeline/convert/convert_part.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/store_writer.h"
#include "bricks/zarr/codec.h"
#include "bricks/zarr/store_names.h"
#include "core/copy_box.h"
#include "pipeline/convert/brick_output.h"
#include "pipeline/convert/convert_cascade.h"
#include "pipeline/convert/convert_units.h"
#include "pipeline/convert/downsample.h"
#include "pipeline/convert/unit_file.h"
#include "pipeline/in_order.h"
#include "pipeline/index/range_scan.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Ranges of a unit's items, gathered as they are completed.
class UnitRanges {
 public:
  /// `items` of the unit, each with a pair of `pair_bytes`.
  UnitRanges(Int3 items, std::size_t pair_bytes)
      : box_{{0, 0, 0}, items},
        pair_bytes_(pair_bytes),
        pairs_(static_cast<std::size_t>(volume(items)) * pair_bytes) {}

  /// Takes the items that are the unit's own; those beyond begin in its neighbours.
  void add(Box3 items, std::span<const std::byte> pairs) {
    const Box3 own = intersect(items, box_);
    if (own.empty()) return;
    copy_box({pairs.data(), items}, {pairs_.data(), box_}, own, pair_bytes_);
  }
  std::span<const std::byte> pairs() const { return pairs_; }

 private:
  Box3 box_;
  std::size_t pair_bytes_;
  std::vector<std::byte> pairs_;
};

/// Makes the units of one part.
class PartConversion {
 public:
  PartConversion(VolumeSource& source, const StoreLayout& layout, const ConvertUnits& units,
                 Part part, int threads, Progress& progress)
      : source_(source),
        layout_(layout),
        lattice_(layout.levels.front().lattice),
        units_(units),
        part_(part),
        bricks_in_flight_(static_cast<std::size_t>(2 * threads + 2)),
        progress_(progress),
        store_(units.folder_of(part), layout, fs::exists(units.folder_of(part) / kLayoutMarker)) {
    fs::create_directories(units.folder_of(part) / "units");
    planes_ = slab_planes(layout);
    const std::vector<std::uint64_t> begins = units.begins_of(part.count);
    units_begin_ = begins[part.number - 1];
    units_end_ = begins[part.number];
  }

  /// Planes of samples that go through memory together: they pair up for the next level.
  static Index slab_planes(const StoreLayout& layout) {
    const Index planes = layout.levels.front().lattice.brick.z;
    return planes % 2 == 0 ? planes : 2 * planes;
  }

  ConvertReport run() {
    ConvertReport report;
    for (std::uint64_t unit = units_begin_; unit < units_end_; ++unit) {
      if (const auto end = find_whole(unit)) {
        report.bricks += end->bricks;
        report.bricks_absent += end->absent;
        report.bricks_kept += end->bricks - end->absent;
        progress_.advance(bytes_of(units_.box(unit)));
      } else {
        make(unit, report);
      }
      report.bytes_in += bytes_of(units_.box(unit));
    }
    store_.sync_shards();
    report.bytes_out = store_.bytes();
    report.levels = 1;
    return report;
  }

 private:
  std::uint64_t bytes_of(Box3 box) const {
    return static_cast<std::uint64_t>(volume(box.extent())) * lattice_.sample_bytes();
  }

  Box3 shards_of(Box3 box) const {
    const Int3 shard = layout_.levels.front().shard;
    return {floor_div(box.lo, shard), ceil_div(box.hi, shard)};
  }

  /// Reads a unit slab by slab, each with the layer beyond the unit's upper borders, for the
  /// ranges. Calls f(slab, what was read), whose samples lie in `samples_` then. The checksum of
  /// them all.
  template <class F>
  std::uint32_t read_unit(Box3 box, const F& f) {
    const Box3 all = intersect({box.lo, box.hi + Int3{1, 1, 1}}, lattice_.box());
    std::uint32_t crc = 0;
    for (Index z = box.lo.z; z < box.hi.z; z += planes_) {
      Box3 slab = box, read = all;
      slab.lo.z = read.lo.z = z;
      slab.hi.z = std::min(z + planes_, box.hi.z);
      if (slab.hi.z < box.hi.z) read.hi.z = slab.hi.z;
      samples_.resize(bytes_of(read));
      read_box(source_, read, samples_.data());
      crc = crc32c({samples_.data(), samples_.size()}, crc);
      f(slab, read);
    }
    return crc;
  }

  /// The end of a unit's file, where that and all of its shards are whole, and made of this input.
  std::optional<UnitEnd> find_whole(std::uint64_t unit) {
    const Box3 box = units_.box(unit);
    const auto file =
        UnitReader::open(units_.file_of(part_, unit), units_.layout_crc32c(), box, true);
    if (!file) return std::nullopt;
    const std::vector<std::uint8_t> has_bricks = file->has_bricks();
    bool is_whole = true;
    std::size_t shard = 0;
    for_each_point(shards_of(box), [&](Int3 s) {
      is_whole = is_whole && (has_bricks[shard++] == 0 || store_.shard_is_whole(0, s));
    });
    if (!is_whole) return std::nullopt;
    const std::uint32_t now = read_unit(box, [](Box3, Box3) {});
    return now == file->end().samples_crc32c ? std::optional(file->end()) : std::nullopt;
  }

  void make(std::uint64_t unit, ConvertReport& report) {
    const Box3 box = units_.box(unit);
    const Int3 with_border = min(box.hi + Int3{1, 1, 1}, lattice_.extent) - box.lo;
    const std::unique_ptr<LevelRanges> ranges =
        make_level_ranges({with_border, lattice_.brick, lattice_.type});
    const Lattice own{box.extent(), lattice_.brick, lattice_.type};
    UnitRanges blocks(own.blocks(), 2 * lattice_.sample_bytes());
    UnitRanges bricks(own.bricks(), 2 * lattice_.sample_bytes());
    const std::unique_ptr<ValueCounts> counts = make_value_counts(lattice_.type);
    BrickOutput output(store_, layout_, 0, nullptr, counts.get(), progress_);
    const Box3 shards = shards_of(box);
    std::vector<std::uint8_t> has_bricks(static_cast<std::size_t>(volume(shards.extent())));
    UnitWriter file(units_.file_of(part_, unit), units_.layout_crc32c(), box);
    const std::uint32_t crc = read_unit(box, [&](Box3 slab, Box3 read) {
      ranges->add({read.lo - box.lo, read.hi - box.lo}, samples_.data());
      ranges->close(
          read.hi.z - box.lo.z,
          [&](Box3 items, std::span<const std::byte> pairs) { blocks.add(items, pairs); },
          [&](Box3 items, std::span<const std::byte> pairs) { bricks.add(items, pairs); });
      own_.resize(bytes_of(slab));
      copy_box({samples_.data(), read}, {own_.data(), slab}, slab, lattice_.sample_bytes());
      write_bricks(slab, output, has_bricks, shards);
      append_coarse(slab, file);
    });
    for_each_point(shards, [&](Int3 s) { store_.finish_shard(0, s); });
    file.finish({blocks.pairs(), bricks.pairs(), counts->counts(), has_bricks, ranges->has_nan(),
                 crc, output.counts().bricks, output.counts().absent});
    report.bricks += output.counts().bricks;
    report.bricks_absent += output.counts().absent;
  }

  /// Notes which of `shards` get bricks.
  void write_bricks(Box3 slab, BrickOutput& output, std::vector<std::uint8_t>& has_bricks,
                    Box3 shards) {
    const Int3 per_shard = ceil_div(layout_.levels.front().shard, lattice_.brick);
    const Box3 bricks = lattice_.bricks_of(slab);
    const Int3 count = bricks.extent();
    Index next = 0;
    const auto take = [&](PackedBrick& packed) {
      if (next == volume(count)) return false;
      packed.brick = bricks.lo + point_at(next++, count);
      return true;
    };
    run_in_order<PackedBrick>(
        bricks_in_flight_, take,
        [&](PackedBrick& packed) { packed = output.pack(packed.brick, slab, own_.data(), false); },
        [&](const PackedBrick& packed) {
          const Int3 shard = floor_div(packed.brick, per_shard) - shards.lo;
          if (packed.encoded)
            has_bricks[static_cast<std::size_t>(linear_index(shard, shards.extent()))] = 1;
          output.deliver(packed);
        });
  }

  void append_coarse(Box3 slab, UnitWriter& file) {
    if (layout_.factors.empty()) return;
    const Int3 extent = coarser_extent(slab.extent(), layout_.factors.front());
    samples_.resize(static_cast<std::size_t>(volume(extent)) * lattice_.sample_bytes());
    downsample(layout_.downsampling, lattice_.type, slab.extent(), layout_.factors.front(),
               own_.data(), samples_.data());
    file.append_coarse(samples_.span());
  }

  VolumeSource& source_;
  const StoreLayout& layout_;
  const Lattice& lattice_;
  const ConvertUnits& units_;
  Part part_;
  std::size_t bricks_in_flight_;
  Index planes_ = 0;
  std::uint64_t units_begin_ = 0, units_end_ = 0;
  Progress& progress_;
  StoreWriter store_;
  PodBuffer<std::byte> samples_, own_;  ///< of a slab with its border, and without
};

/// Throws UsageError where the budget has no room for a slab of a unit.
void check_memory(const StoreLayout& layout, const ConvertUnits& units, std::uint64_t source_bytes,
                  std::uint64_t memory, int threads) {
  const Lattice& lattice = layout.levels.front().lattice;
  const Int3 unit = units.box(0).extent() + Int3{1, 1, 1};
  const Index planes = std::min(PartConversion::slab_planes(layout) + 1, unit.z);
  const std::uint64_t slab =
      static_cast<std::uint64_t>(unit.x * unit.y * planes) * lattice.sample_bytes();
  const std::uint64_t brick = lattice.brick_bytes();
  const std::uint64_t least =
      kProgramBytes + source_bytes + value_counts_bytes(lattice.type, threads) + 2 * slab +
      static_cast<std::uint64_t>(threads) *
          (4 * brick + encoder_memory(layout.codecs(), static_cast<std::size_t>(brick))) +
      2 * brick;
  if (memory < least)
    throw UsageError(
        fmt::format("a memory budget of {:.1f} MiB is too small: a part of a conversion needs "
                    "--memory {}M at least with {} threads; or choose smaller shards",
                    in_mib(memory), mib_above(least), threads));
}

}  // namespace

void check_part_output(const fs::path& out, const ConvertOptions& options) {
  if (options.join > 0)
    throw UsageError("a part is made or all parts are joined, not both at once");
  if (!options.force && fs::exists(fs::symlink_status(out)))
    throw UsageError(
        fmt::format("'{}' exists; --force makes parts of another in its place", out.string()));
}

ConvertReport convert_part(VolumeSource& source, const StoreLayout& layout, const fs::path& out,
                           const ConvertOptions& options, Progress& progress) {
  const ConvertUnits units(layout, out);
  if (!source.random_access())
    throw UsageError("parts of a conversion need an input that is read in any order, not a stream");
  Workers workers(options.threads);
  check_memory(layout, units, source.memory(), options.memory, workers.threads());
  std::uint64_t bytes = 0;
  const std::vector<std::uint64_t> begins = units.begins_of(options.part->count);
  for (std::uint64_t unit = begins[options.part->number - 1]; unit < begins[options.part->number];
       ++unit)
    bytes +=
        static_cast<std::uint64_t>(volume(units.box(unit).extent())) * size_of(source.info().type);
  progress.begin("convert", bytes);
  ConvertReport report = workers.execute([&] {
    return PartConversion(source, layout, units, *options.part, workers.threads(), progress).run();
  });
  progress.end();
  return report;
}

}  // namespace isobrick
