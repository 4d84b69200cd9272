#include "pipeline/convert/convert_join.h"

#include <algorithm>
#include <set>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/zarr/store_names.h"
#include "core/copy_box.h"
#include "io/bytes/output_folder.h"
#include "pipeline/check_part.h"
#include "pipeline/convert/downsample.h"
#include "pipeline/convert/unit_file.h"

namespace isobrick::inline v0 {
namespace fs = std::filesystem;

/// Level 1, as the parts left it.
class JoinedParts::Coarser final : public VolumeSource {
 public:
  Coarser(const StoreLayout& layout, const JoinedParts& parts)
      : units_(parts.units_), parts_(parts), factors_(layout.factors.front()) {
    info_.extent = layout.levels[1].lattice.extent;
    info_.type = layout.levels[1].lattice.type;
    info_.transform = layout.levels[1].transform;
    info_.fill_value = layout.fill_value;
    info_.name = layout.name;
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }

  void read(Box3 box, std::byte* out) override {
    for (std::uint64_t unit = 0; unit < units_.count(); ++unit) {
      const Box3 whole = coarser_box(unit);
      const Box3 part = intersect(whole, box);
      if (!part.empty()) read_unit(unit, whole, part, {out, box});
    }
  }

 private:
  Box3 coarser_box(std::uint64_t unit) const {
    const Box3 box = units_.box(unit);
    const Int3 lo = floor_div(box.lo, factors_);
    return {lo, lo + coarser_extent(box.extent(), factors_)};
  }

  /// Whole planes of the unit at a time: they lie together.
  void read_unit(std::uint64_t unit, Box3 whole, Box3 part, BoxSamples<std::byte> out) const {
    const auto file = UnitReader::open(units_.file_of(parts_.part_of(unit), unit),
                                       units_.layout_crc32c(), units_.box(unit), false);
    if (!file) throw Error(fmt::format("unit {} of a conversion has changed meanwhile", unit));
    const std::size_t bytes = size_of(info_.type);
    const Int3 e = whole.extent();
    const std::uint64_t plane = static_cast<std::uint64_t>(e.x * e.y) * bytes;
    std::vector<std::byte> samples(plane);
    for (Index z = part.lo.z; z < part.hi.z; ++z) {
      file->read_coarse(static_cast<std::uint64_t>(z - whole.lo.z) * plane, samples);
      Box3 of_plane = whole, wanted = part;
      of_plane.lo.z = wanted.lo.z = z;
      of_plane.hi.z = wanted.hi.z = z + 1;
      copy_box({samples.data(), of_plane}, out, wanted, bytes);
    }
  }

  const ConvertUnits& units_;
  const JoinedParts& parts_;
  Int3 factors_;
  VolumeInfo info_;
};

JoinedParts::JoinedParts(const StoreLayout& layout, const fs::path& out, std::uint32_t parts)
    : layout_(layout), units_(layout, out), parts_(parts), begins_(units_.begins_of(parts)) {
  std::set<std::uint32_t> missing;
  for (std::uint64_t unit = 0; unit < units_.count(); ++unit) {
    const Part part = part_of(unit);
    if (!UnitReader::open(units_.file_of(part, unit), units_.layout_crc32c(), units_.box(unit),
                          true))
      missing.insert(part.number);
  }
  if (!missing.empty())
    throw UsageError(
        fmt::format("'{}' has no whole part{} {}; convert the same input with the same options and "
                    "--part {}/{}",
                    units_.folder().string(), missing.size() == 1 ? "" : "s",
                    numbers_of_parts(missing), *missing.begin(), parts));
  if (!layout.factors.empty()) coarser_ = std::make_unique<Coarser>(layout, *this);
}

JoinedParts::~JoinedParts() = default;

Part JoinedParts::part_of(std::uint64_t unit) const {
  const auto after = std::upper_bound(begins_.begin(), begins_.end(), unit);
  return {static_cast<std::uint32_t>(after - begins_.begin()), parts_};
}

JoinedParts::Counts JoinedParts::add_to(StoreWriter& store, ValueCounts& values) const {
  const LevelInfo& level = layout_.levels.front();
  constexpr Int3 blocks{kBlockEdge, kBlockEdge, kBlockEdge};
  Counts all;
  for (std::uint64_t unit = 0; unit < units_.count(); ++unit) {
    const Part part = part_of(unit);
    const Box3 box = units_.box(unit);
    const auto file =
        UnitReader::open(units_.file_of(part, unit), units_.layout_crc32c(), box, false);
    if (!file) throw Error(fmt::format("unit {} of a conversion has changed meanwhile", unit));
    const std::vector<std::uint8_t> has_bricks = file->has_bricks();
    std::size_t shard = 0;
    for_each_point({floor_div(box.lo, level.shard), ceil_div(box.hi, level.shard)}, [&](Int3 s) {
      if (has_bricks[shard++] == 0) return store.finish_shard(0, s);
      if (!store.take_shard(0, s, units_.folder_of(part)))
        throw UsageError(fmt::format("'{}' lacks a shard: run part {} of {} again",
                                     units_.folder_of(part).string(), part.number, part.count));
      store.keep_shard(0, s);
    });
    store.put_block_ranges(0, {floor_div(box.lo, blocks), ceil_div(box.hi, blocks)},
                           file->block_ranges());
    store.put_brick_ranges(0, level.lattice.bricks_of(box), file->brick_ranges());
    add_counts(file->counts(), values);
    all.bricks += file->end().bricks;
    all.absent += file->end().absent;
    all.has_nan = all.has_nan || file->end().has_nan != 0;
  }
  return all;
}

VolumeSource& JoinedParts::coarser() const { return *coarser_; }

void JoinedParts::remove() const {
  for (std::uint32_t number = 1; number <= parts_; ++number) {
    const fs::path folder = units_.folder_of({number, parts_});
    std::error_code none;
    if (fs::exists(folder / kLayoutMarker, none))
      OutputFolder(units_.folder()).remove_folder(folder);
  }
  std::error_code others;  // somebody else's files stay, and the folder with them
  fs::remove(units_.folder(), others);
}

}  // namespace isobrick
