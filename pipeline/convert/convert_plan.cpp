#include "pipeline/convert/convert_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include <isobrick/error.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/ranges/range_format.h"
#include "bricks/zarr/codec.h"
#include "pipeline/convert/codec_choice.h"
#include "pipeline/convert/downsample.h"
#include "pipeline/index/range_scan.h"
#include "pipeline/index/value_counts.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_piece.h"

namespace isobrick::inline v0 {
namespace {

/// What a reader takes.
constexpr int kMaxLevels = 64;

constexpr Index kBrick = 64, kShard = 512;

/// A box of no more than volume(box) items that follows the shape of `whole`: while an axis of the
/// box is shorter than that of `whole`, the one that lies over most boxes is doubled. None becomes
/// longer than `longest`.
Int3 follow_shape(Int3 box, Int3 whole, Index items, Index longest) {
  for (;;) {
    int large = -1;
    for (int axis = 0; axis < 3; ++axis)
      if (box[axis] < whole[axis] && 2 * box[axis] <= longest &&
          (large < 0 || ceil_div(whole[axis], box[axis]) > ceil_div(whole[large], box[large])))
        large = axis;
    if (large < 0 || 2 * volume(box) > items) return box;
    box[large] *= 2;
  }
}

/// Samples of a brick.
Int3 brick_extent(Int3 extent, std::optional<Index> edge, bool sparse) {
  const Index most = edge.value_or(kBrick);
  Int3 brick;
  for (int axis = 0; axis < 3; ++axis) {
    brick[axis] = sparse ? kBlockEdge : 1;
    while (brick[axis] < extent[axis]) brick[axis] *= 2;
    brick[axis] = std::min(brick[axis], most);
  }
  if (edge) return brick;
  const Index longest = sparse ? kRangeChunkEdge * kBlockEdge : kMaxAxisSamples;
  return follow_shape(brick, extent, kBrick * kBrick * kBrick, longest);
}

/// How many bricks a shard has along each axis; no more than a level has.
Int3 bricks_of_shard(const Lattice& lattice, const ConvertOptions& options) {
  if (options.ome == OmeVersion::v04) return {1, 1, 1};
  const Index edge =
      std::max<Index>(1, options.shard.value_or(kShard) / options.brick.value_or(kBrick));
  const Int3 bricks = lattice.bricks();
  const Int3 cube = min({edge, edge, edge}, bricks);
  if (options.shard) return cube;
  return min(follow_shape(cube, bricks, edge * edge * edge, kMaxAxisSamples), bricks);
}

Int3 shard_extent(const Lattice& lattice, const ConvertOptions& options) {
  return bricks_of_shard(lattice, options) * lattice.brick;
}

/// Whether a brick holds the whole level.
bool is_one_brick(const Lattice& lattice) { return lattice.bricks() == Int3{1, 1, 1}; }

/// Whether an axis is halved that does not fit into a brick.
bool halves_long_axis(Int3 factors, const Lattice& lattice) {
  bool any = false;
  for (int axis = 0; axis < 3; ++axis) any |= factors[axis] == 2 && lattice.bricks()[axis] > 1;
  return any;
}

/// By spacing, but for volumes that have become thin: of these only the long axes are halved.
Int3 own_factors(const LevelInfo& level) {
  const Lattice& lattice = level.lattice;
  const Int3 factors = factors_by_spacing(level.transform, lattice.extent);
  if (is_one_brick(lattice) || halves_long_axis(factors, lattice)) return factors;
  const Int3 bricks = lattice.bricks();
  return {bricks.x > 1 ? 2 : 1, bricks.y > 1 ? 2 : 1, bricks.z > 1 ? 2 : 1};
}

/// From `level`, which is number `step` of the pyramid, to the next one.
Int3 factors_of(const ConvertOptions& options, const LevelInfo& level, std::size_t step) {
  if (options.factors.empty()) return own_factors(level);
  return options.factors[std::min(step, options.factors.size() - 1)];
}

/// Whether no further level gets nearer to one that a brick holds.
bool is_coarsest(const ConvertOptions& options, const LevelInfo& level, std::size_t step) {
  if (is_one_brick(level.lattice)) return true;
  return step + 1 >= options.factors.size() && !options.factors.empty() &&
         !halves_long_axis(options.factors.back(), level.lattice);
}

/// Adds coarser levels to the finest one, as many as requested or until one brick holds the
/// last. Where the factors leave an axis as it is, they may end before.
void add_levels(StoreLayout& layout, const ConvertOptions& options) {
  const auto wanted = static_cast<std::size_t>(options.levels.value_or(kMaxLevels));
  while (layout.levels.size() < wanted) {
    LevelInfo level = layout.levels.back();
    const Int3 extent = level.lattice.extent;
    if (!options.levels && is_coarsest(options, level, layout.factors.size())) return;
    const Int3 factors = factors_of(options, level, layout.factors.size());
    level.lattice.extent = coarser_extent(extent, factors);
    if (level.lattice.extent == extent) break;
    level.transform = coarser_transform(level.transform, extent, factors, layout.downsampling);
    level.shard = shard_extent(level.lattice, options);
    layout.levels.push_back(level);
    layout.factors.push_back(factors);
  }
  const Int3 finest = layout.levels.front().lattice.extent;
  if (options.levels && layout.levels.size() < wanted)
    throw UsageError(fmt::format("{} levels: a volume of {} × {} × {} samples can have 1 to {}",
                                 *options.levels, finest.x, finest.y, finest.z,
                                 layout.levels.size()));
}

void check_options(const VolumeInfo& volume, const ConvertOptions& options) {
  if (!checked_volume(volume.extent))
    throw UsageError(fmt::format("'{}': {} × {} × {} samples are none or too many", volume.name,
                                 volume.extent.x, volume.extent.y, volume.extent.z));
  const Index brick = options.brick.value_or(kBrick), shard = options.shard.value_or(kShard);
  if (brick < 16 || brick > 256)
    throw UsageError(fmt::format("bricks of {}³ samples: 16 to 256 are possible", brick));
  if (shard < brick)
    throw UsageError(
        fmt::format("shards of {}³ samples are smaller than bricks of {}³", shard, brick));
  check_codec(options.codec, options.zstd_level, options.packed_factor, options.ome);
  if (options.threads < 0) throw UsageError(fmt::format("{} threads", options.threads));
  if (options.levels && (*options.levels < 1 || *options.levels > kMaxLevels))
    throw UsageError(fmt::format("{} levels: 1 to {} are possible", *options.levels, kMaxLevels));
  for (const Int3& f : options.factors)
    if (min(f, {1, 1, 1}) != Int3{1, 1, 1} || max(f, {2, 2, 2}) != Int3{2, 2, 2} ||
        f == Int3{1, 1, 1})
      throw UsageError(fmt::format("factors {},{},{}: each is 1 or 2, and at least one of them 2",
                                   f.x, f.y, f.z));
}

}  // namespace

StoreLayout plan_layout(const VolumeInfo& volume, const ConvertOptions& options, bool sparse) {
  check_options(volume, options);
  StoreLayout layout;
  // A choice is made once bricks are known; one of these two it is.
  layout.codec = options.codec == BrickCodec::automatic ? BrickCodec::zstd : options.codec;
  layout.zstd_level = options.zstd_level;
  layout.fill_value = volume.fill_value;
  layout.grid_class = volume.grid_class;
  layout.grid_name = volume.grid_name;
  layout.labels = volume.labels;
  layout.name = std::filesystem::path(volume.name).filename().string();
  layout.ome = options.ome;
  LevelInfo finest;
  finest.lattice = {volume.extent, brick_extent(volume.extent, options.brick, sparse), volume.type};
  finest.transform = volume.transform;
  finest.shard = shard_extent(finest.lattice, options);
  layout.levels.push_back(finest);
  layout.downsampling =
      options.downsampling.value_or(volume.labels ? Downsampling::mode : Downsampling::mean);
  add_levels(layout, options);
  return layout;
}

ConvertPlan::ConvertPlan(const StoreLayout& layout, std::uint64_t memory, int threads,
                         bool random_access, std::size_t source_bytes, std::uint64_t index_memory)
    : layout_(layout),
      source_bytes_(source_bytes),
      threads_(threads),
      bricks_in_flight_(2 * threads + 2) {
  const Lattice& lattice = layout.levels.front().lattice;
  slab_planes_ = lattice.brick.z % 2 == 0 ? lattice.brick.z : 2 * lattice.brick.z;
  const std::size_t samples = min_room(random_access);
  // Large bricks in a small budget: rather fewer at a time than none at all.
  while (bricks_in_flight_ > 1 && encoding_bytes() + samples > memory) {
    --bricks_in_flight_;
    threads_ = std::min(threads_, bricks_in_flight_);
  }
  const std::size_t least = encoding_bytes() + samples;
  if (memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: bricks of {} × {} × {} samples{} need "
        "--memory {}M at least, {} MiB of it for the program and its libraries, the "
        "rest for a layer of bricks, its ranges and encoding them",
        in_mib(memory), lattice.brick.x, lattice.brick.y, lattice.brick.z,
        index_memory > least ? " and the index" : "",
        mib_above(std::max<std::uint64_t>(least, index_memory)), kProgramBytes / kMiB));
  room_ = static_cast<std::size_t>(memory) - encoding_bytes();
}

std::size_t ConvertPlan::encoding_bytes() const {
  const Lattice& finest = layout_.levels.front().lattice;
  const std::size_t brick = finest.brick_bytes();
  return kProgramBytes + source_bytes_ + value_counts_bytes(finest.type, threads_) +
         static_cast<std::size_t>(threads_) *
             (2 * brick + encoder_memory(layout_.codecs(), brick)) +
         static_cast<std::size_t>(bricks_in_flight_) * brick;
}

std::size_t ConvertPlan::slab_bytes(int level) const {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  const Int3 e = lattice.extent;
  return static_cast<std::size_t>(e.x * e.y * std::min(e.z, slab_planes_)) * lattice.sample_bytes();
}

std::size_t ConvertPlan::ranges_bytes(int level) const {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  // The scanner's open layers, and the layers of chunks that the writer gathers.
  return level_ranges_bytes(lattice, slab_planes_) + gathered_ranges_bytes(lattice) +
         brick_checksum_bytes(layout_.levels[static_cast<std::size_t>(level)]);
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
  // Beside a piece lies the part of it that goes to the next level.
  const std::size_t parts = coarser_part();
  const std::size_t room = (room_ - ranges_bytes(level)) / (parts + 1) * parts;
  return largest_piece(lattice.extent, min_piece(), room / lattice.sample_bytes());
}

/// A brick, or two where its samples would not pair up for the next level.
Int3 ConvertPlan::min_piece() const {
  Int3 piece = layout_.levels.front().lattice.brick;
  for (int axis = 0; axis < 3; ++axis)
    if (piece[axis] % 2 != 0) piece[axis] *= 2;
  return piece;
}

std::size_t ConvertPlan::coarser_part() const {
  Index part = volume(kHalveAll);
  for (const Int3& factors : layout_.factors) part = std::min(part, volume(factors));
  return static_cast<std::size_t>(part);
}

Index ConvertPlan::spool_planes() const {
  const Lattice& lattice = layout_.levels.front().lattice;
  const std::size_t plane =
      static_cast<std::size_t>(lattice.extent.x * lattice.extent.y) * lattice.sample_bytes();
  constexpr std::size_t kEnough = 64 * kMiB;
  return std::max<Index>(1, static_cast<Index>(std::min(room_, kEnough) / plane));
}

std::size_t ConvertPlan::min_room(bool random_access) const {
  const Lattice& lattice = layout_.levels.front().lattice;
  const std::size_t cube = static_cast<std::size_t>(volume(min_piece())) * lattice.sample_bytes();
  const std::size_t parts = coarser_part();
  const std::size_t pieces = ranges_bytes(0) + cube / parts * (parts + 1) + parts + 1;
  const std::size_t plane =
      static_cast<std::size_t>(lattice.extent.x * lattice.extent.y) * lattice.sample_bytes();
  return std::min(cascade_bytes(0), random_access ? pieces : std::max(pieces, plane));
}

}  // namespace isobrick
