#include "isobrick/pipeline/convert_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "isobrick/bricks/codec.h"
#include "isobrick/core/error.h"
#include "isobrick/pipeline/downsample.h"
#include "isobrick/pipeline/range_scan.h"
#include "isobrick/pipeline/slab_piece.h"

namespace isobrick {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
/// Program, libraries and stacks.
constexpr std::size_t kProgramBytes = 24 * kMiB;

Index longest(Int3 e) { return std::max({e.x, e.y, e.z}); }

/// Samples of a shard: no larger than the bricks that the level has.
Int3 shard_extent(const Lattice& lattice, Index shard) {
  const Int3 whole = lattice.bricks() * lattice.brick;
  return min({shard, shard, shard}, whole);
}

int level_count(Int3 extent, Index brick, std::optional<int> asked) {
  int until_brick = 1, until_one = 1;
  for (Int3 e = extent; longest(e) > 1; e = half_extent(e)) {
    ++until_one;
    if (longest(e) > brick) ++until_brick;
  }
  if (!asked) return until_brick;
  if (*asked < 1 || *asked > until_one)
    throw UsageError(fmt::format("{} levels: a volume of {} × {} × {} samples can have 1 to {}",
                                 *asked, extent.x, extent.y, extent.z, until_one));
  return *asked;
}

void check_options(const VolumeInfo& volume, const ConvertOptions& options) {
  if (!checked_volume(volume.extent))
    throw UsageError(fmt::format("'{}': {} × {} × {} samples are none or too many", volume.name,
                                 volume.extent.x, volume.extent.y, volume.extent.z));
  if (options.brick < 16 || options.brick > 256)
    throw UsageError(fmt::format("bricks of {}³ samples: 16 to 256 are possible", options.brick));
  if (options.shard < options.brick)
    throw UsageError(fmt::format("shards of {}³ samples are smaller than bricks of {}³",
                                 options.shard, options.brick));
  if (options.zstd_level && (*options.zstd_level < 1 || *options.zstd_level > 22))
    throw UsageError(fmt::format("zstd level {}: 1 to 22 are possible", *options.zstd_level));
  if (options.threads < 0) throw UsageError(fmt::format("{} threads", options.threads));
}

}  // namespace

StoreLayout plan_layout(const VolumeInfo& volume, const ConvertOptions& options) {
  check_options(volume, options);
  StoreLayout layout;
  layout.zstd_level = options.zstd_level;
  layout.fill_value = volume.fill_value;
  layout.grid_class = volume.grid_class;
  layout.grid_name = volume.grid_name;
  layout.name = std::filesystem::path(volume.name).filename().string();
  const Index shard = options.shard / options.brick * options.brick;
  LevelInfo level;
  level.lattice = {volume.extent, {options.brick, options.brick, options.brick}, volume.type};
  level.transform = volume.transform;
  for (int left = level_count(volume.extent, options.brick, options.levels); left > 0; --left) {
    level.shard = shard_extent(level.lattice, shard);
    layout.levels.push_back(level);
    level.transform = half_transform(level.transform, level.lattice.extent);
    level.lattice.extent = half_extent(level.lattice.extent);
  }
  return layout;
}

ConvertPlan::ConvertPlan(const StoreLayout& layout, std::uint64_t memory, int threads,
                         bool random_access, std::size_t source_bytes)
    : layout_(layout),
      source_bytes_(source_bytes),
      threads_(threads),
      bricks_in_flight_(2 * threads + 2) {
  const Lattice& lattice = layout.levels.front().lattice;
  slab_planes_ = lattice.brick.z % 2 == 0 ? lattice.brick.z : 2 * lattice.brick.z;
  const std::size_t samples = least_room(random_access);
  // Large bricks in a small budget: rather fewer at a time than none at all.
  while (bricks_in_flight_ > 1 && encoding_bytes() + samples > memory) {
    --bricks_in_flight_;
    threads_ = std::min(threads_, bricks_in_flight_);
  }
  const std::size_t least = encoding_bytes() + samples;
  if (memory < least)
    throw UsageError(
        fmt::format("a memory budget of {} MiB is too small: bricks of {}³ samples need {} MiB at "
                    "least",
                    memory / kMiB, lattice.brick.x, least / kMiB + 1));
  room_ = static_cast<std::size_t>(memory) - encoding_bytes();
}

std::size_t ConvertPlan::encoding_bytes() const {
  const std::size_t brick = layout_.levels.front().lattice.brick_bytes();
  return kProgramBytes + source_bytes_ +
         static_cast<std::size_t>(threads_) *
             (2 * brick + encoder_memory(layout_.zstd_level, brick)) +
         static_cast<std::size_t>(bricks_in_flight_) * brick;
}

std::size_t ConvertPlan::slab_bytes(int level) const {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  const Int3 e = lattice.extent;
  return static_cast<std::size_t>(e.x * e.y * std::min(e.z, slab_planes_)) * lattice.sample_bytes();
}

std::size_t ConvertPlan::ranges_bytes(int level) const {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  // The scanner's open layers, and the layer of chunks that the writer gathers.
  return level_ranges_bytes(lattice, slab_planes_) +
         level_ranges_bytes(lattice, StoreReader::kRangeChunk * kBlockEdge);
}

std::size_t ConvertPlan::cascade_bytes(int level) const {
  std::size_t bytes = 0;
  for (int l = level; l < static_cast<int>(layout_.levels.size()); ++l)
    bytes += slab_bytes(l) + ranges_bytes(l);
  return bytes;
}

bool ConvertPlan::second_slab_fits() const { return cascade_bytes(0) + slab_bytes(0) <= room_; }

Int3 ConvertPlan::piece(int level) const {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  const Index s = slab_planes_;
  // Beside a piece lies the eighth of it that goes to the next level.
  const std::size_t room = (room_ - ranges_bytes(level)) / 9 * 8;
  return largest_piece(lattice.extent, {s, s, s}, room / lattice.sample_bytes());
}

Index ConvertPlan::spool_planes() const {
  const Lattice& lattice = layout_.levels.front().lattice;
  const std::size_t plane =
      static_cast<std::size_t>(lattice.extent.x * lattice.extent.y) * lattice.sample_bytes();
  constexpr std::size_t kEnough = 64 * kMiB;
  return std::max<Index>(1, static_cast<Index>(std::min(room_, kEnough) / plane));
}

std::size_t ConvertPlan::least_room(bool random_access) const {
  const Lattice& lattice = layout_.levels.front().lattice;
  const std::size_t cube =
      static_cast<std::size_t>(slab_planes_ * slab_planes_ * slab_planes_) * lattice.sample_bytes();
  const std::size_t pieces = ranges_bytes(0) + cube / 8 * 9 + 9;
  const std::size_t plane =
      static_cast<std::size_t>(lattice.extent.x * lattice.extent.y) * lattice.sample_bytes();
  return std::min(cascade_bytes(0), random_access ? pieces : std::max(pieces, plane));
}

}  // namespace isobrick
