#include "pipeline/volume/volume_pass.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <new>
#include <optional>
#include <span>
#include <utility>

#include <isobrick/error.h>
#include "core/box_union.h"
#include "core/length_unit.h"
#include "core/machine_memory.h"
#include "core/morton.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/program_memory.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kOne{1, 1, 1};
/// Tiles along each edge of a region at most: the layers around it are a twentieth of it then.
constexpr Index kMaxRegion = 4;
/// Regions between two reports of progress, and tiles.
constexpr std::size_t kRegionsAtOnce = 64;
constexpr std::size_t kMaxTilesAtOnce = 2048;
/// A thread makes so many tiles of noise in some tenths of a second: a stop waits no longer.
constexpr std::size_t kTilesOfThread = 128;
/// Bytes of lists for each tile: first one of regions to scan, then one of active tiles.
constexpr std::uint64_t kListedTile = std::max(sizeof(Box3), sizeof(TileWork));
/// Triangles number no more vertices.
constexpr std::uint64_t kMaxVertices = std::uint64_t{1} << 32;
/// Larger chunks of a mesh gain nothing.
constexpr std::uint64_t kMaxOutput = std::uint64_t{32} << 20;

/// The samples of a region of tiles and `reach` layers around their cells.
Box3 samples_of(Box3 tiles, Index reach, const Lattice& lattice) {
  return intersect({tiles.lo * kTileEdge - kOne * reach, tiles.hi * kTileEdge + kOne * (1 + reach)},
                   lattice.box());
}

/// The boxes of `edge` that a box of tiles meets, cut at it, x fastest.
std::vector<Box3> cut(Box3 tiles, Int3 edge) {
  const Box3 grid{floor_div(tiles.lo, edge), ceil_div(tiles.hi, edge)};
  std::vector<Box3> parts;
  parts.reserve(static_cast<std::size_t>(volume(grid.extent())));  // no more, the budget has it
  for_each_point(grid, [&](Int3 p) {
    parts.push_back(intersect({p * edge, (p + kOne) * edge}, tiles));
  });
  return parts;
}

/// The blocks of whole tiles.
Box3 blocks_of(Box3 tiles, const Lattice& lattice) {
  constexpr Index blocks = kTileEdge / kBlockEdge;
  return intersect({tiles.lo * blocks, tiles.hi * blocks}, {{0, 0, 0}, lattice.blocks()});
}

/// Makes room for `count` elements, in large pages unless one of these is more than that. An array
/// that was used before grows where it must.
template <class T>
void reserve(std::size_t count, PodBuffer<T>& buffer) {
  constexpr std::size_t worth = detail::kLargeMemory / 8 / sizeof(T);
  constexpr std::size_t large = detail::kLargeMemory / sizeof(T) + 1;
  if (buffer.capacity() == 0) buffer.reserve(count < worth ? count : std::max(count, large));
}

/// Makes room for the mesh of so many active blocks, as smooth surfaces have it. In memory of the
/// process this takes addresses only, until the mesh is written; of a resource it would take all.
void reserve(std::size_t blocks, bool normals, Mesh& mesh) {
  constexpr std::size_t vertices = 1024, triangles = 2048;
  constexpr std::size_t bytes = 2 * vertices * sizeof(Vec3f) + triangles * sizeof(Triangle);
  if (mesh.positions.memory()) return;
  static const std::uint64_t allowed = allowed_memory();
  blocks = static_cast<std::size_t>(
      std::min({std::uint64_t{blocks}, kMaxVertices / vertices, allowed / 2 / bytes}));
  try {
    reserve(blocks * vertices, mesh.positions);
    if (normals) reserve(blocks * vertices, mesh.normals);
    reserve(blocks * triangles, mesh.triangles);
  } catch (const std::bad_alloc&) {
    // The system gives no more addresses at once: the mesh may be far smaller.
  }
}

/// A mesh that is another's for a while. It goes back whatever happens, without its elements unless
/// it is complete: an exception must not cost its owner the memory.
class LentMesh {
 public:
  LentMesh(Mesh& owner, Mesh& user) : owner_(owner), user_(user) {
    user_ = std::move(owner_);
    user_.clear();
  }
  ~LentMesh() {
    if (!is_complete_) user_.clear();
    owner_ = std::move(user_);
  }
  LentMesh(const LentMesh&) = delete;
  LentMesh& operator=(const LentMesh&) = delete;

  void complete() { is_complete_ = true; }

 private:
  Mesh& owner_;
  Mesh& user_;
  bool is_complete_ = false;
};

std::size_t count_blocks(const std::vector<TileWork>& tiles) {
  std::size_t blocks = 0;
  for (const TileWork& work : tiles)
    blocks += static_cast<std::size_t>(std::popcount(work.active_blocks));
  return blocks;
}

}  // namespace

VolumePass::VolumePass(VolumeSamples& samples, const ExtractOptions& options, Indexing indexing,
                       std::shared_ptr<TileWorkSpaces> spaces)
    : samples_(samples),
      memory_(options.memory),
      others_(options.memory_of_others),
      workers_(options.threads),
      spaces_(std::move(spaces)) {
  const Lattice& lattice = samples.lattice;
  if (options.level != 0)
    throw UsageError(fmt::format("a volume without a store has no level {}", options.level));
  if (std::isnan(options.isovalue)) throw UsageError("the isovalue is not a number");
  if (options.backend == Backend::cuda)
    throw UsageError("samples in host memory are extracted on the CPU");
  check_transform(samples.transform, lattice.extent, "the volume");
  surface_ = {.isovalue = options.isovalue,
              .inside = options.inside.value_or(Inside::above),
              .normals = options.normals,
              .indexing = indexing,
              .drop_degenerate = options.drop_degenerate,
              .topology = options.topology,
              .cap = options.cap,
              .roi = options.roi.value_or(lattice.box()),
              .transform = samples.transform};
  check_roi(surface_.roi, lattice.extent);
}

/// As if samples were NaN, which is not known before they are scanned.
CapBounds VolumePass::bounds_of_cap() const {
  SurfaceOptions surface = surface_;
  surface.may_have_nan = is_floating(samples_.lattice.type);
  return cap_bounds(surface);
}

/// Appends the tiles of a box in which the surface may lie.
void VolumePass::append_tiles(Box3 tiles, std::vector<TileWork>& out) const {
  samples_.ranges->append_tiles(tiles, surface_.isovalue, cap_search(surface_), out);
}

/// What every extraction takes besides its surface and its regions.
std::uint64_t VolumePass::fixed_bytes() const {
  const Lattice& lattice = samples_.lattice;
  const auto tiles = static_cast<std::uint64_t>(volume(lattice.tiles()));
  const bool in_place = samples_.array
                            ? samples_.array->in_place() != nullptr
                            : !samples_.missing.any() && samples_.read_type == lattice.type;
  const std::uint64_t scans =
      in_place ? 0 : static_cast<std::uint64_t>(workers_.threads()) * range_scan_bytes(lattice);
  return samples_.source_bytes + samples_.range_bytes() + tiles * kListedTile + scans +
         CpuExtractor::boundary_bytes(lattice.tiles(), surface_.drop_degenerate, bounds_of_cap());
}

/// Divides the budget among the ranges, what waits between tiles, work spaces, output and regions.
void VolumePass::plan(bool has_sink, std::uint64_t sink_bytes) {
  const Lattice& lattice = samples_.lattice;
  const std::uint64_t workspace = CpuExtractor::workspace_bytes(
      lattice.type, surface_.drop_degenerate, surface_.topology, bounds_of_cap());
  const std::uint64_t tile_output =
      CpuExtractor::max_tile_output(surface_.normals, surface_.topology, bounds_of_cap());
  const auto region_bytes = [&](Index edge) -> std::uint64_t {
    if (samples_.array) return 0;
    const Int3 n = min(kOne * (edge * kTileEdge + 3), lattice.extent);
    return 2 * static_cast<std::uint64_t>(volume(n)) * size_of(samples_.read_type);
  };
  const std::uint64_t least =
      sink_bytes + fixed_bytes() + workspace + region_bytes(1) + (has_sink ? 2 * tile_output : 0);
  if (memory_ < least || memory_ - least < others_)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small for this volume: at least {} MiB are needed",
        in_mib(memory_), mib_above(least + others_)));
  samples_.make_ranges();
  // Half of what is left for the regions and the output, half for work spaces.
  std::uint64_t left = memory_ - least - others_;
  const std::uint64_t tiles = std::min<std::uint64_t>(
      CpuExtractor::preferred_batch(workers_.threads()), 1 + left / 2 / workspace);
  left -= (tiles - 1) * workspace;
  region_tiles_ = kMaxRegion;
  while (region_tiles_ > 1 && region_bytes(region_tiles_) - region_bytes(1) > left / 2)
    region_tiles_ /= 2;
  left -= region_bytes(region_tiles_) - region_bytes(1);
  limits_.tiles = static_cast<std::size_t>(tiles);
  if (has_sink) limits_.output_bytes = std::min(tile_output + left / 2, tile_output + kMaxOutput);
}

Box3 VolumePass::tiles_of_roi() const {
  return {floor_div(surface_.roi.lo, kOne * kTileEdge),
          ceil_div(surface_.roi.hi, kOne * kTileEdge)};
}

std::uint64_t VolumePass::sample_bytes(Box3 tiles) const {
  const Box3 box = intersect({tiles.lo * kTileEdge, tiles.hi * kTileEdge}, samples_.lattice.box());
  return static_cast<std::uint64_t>(volume(box.extent())) * size_of(samples_.read_type);
}

/// Finds the ranges that samples in memory lack yet.
void VolumePass::find_ranges(Progress& progress) {
  const ArraySamples& array = *samples_.array;
  Int3 edge = kOne;
  edge[array.axes()[0]] = 16;  // long rows: memory is read in order
  std::vector<Box3> regions = cut(tiles_of_roi(), edge);
  std::erase_if(regions, [&](Box3 tiles) { return samples_.is_known(tiles); });
  if (regions.empty()) return;
  std::uint64_t bytes = 0;
  for (const Box3& tiles : regions) bytes += sample_bytes(tiles);
  progress.begin("finding ranges", bytes);
  for (std::size_t i = 0; i < regions.size(); i += kRegionsAtOnce) {
    const auto some = std::span(regions).subspan(i, std::min(kRegionsAtOnce, regions.size() - i));
    workers_.execute([&] {
      tbb::parallel_for(
          std::size_t{0}, some.size(),
          [&](std::size_t j) {
            samples_.ranges->scan(array, blocks_of(some[j], samples_.lattice));
          },
          tbb::simple_partitioner());
    });
    std::uint64_t done = 0;
    for (const Box3& tiles : some) {
      samples_.set_known(tiles);
      done += sample_bytes(tiles);
    }
    progress.advance(done);
  }
  progress.end();
}

std::vector<TileWork> VolumePass::active_tiles() const {
  std::vector<TileWork> tiles;
  tiles.reserve(static_cast<std::size_t>(volume(samples_.lattice.tiles())));
  append_tiles(samples_.all_tiles(), tiles);
  const Box3 roi = tiles_of_roi();
  std::erase_if(tiles, [&](const TileWork& work) { return !roi.contains(work.tile); });
  return tiles;
}

Box3 VolumePass::active_cells(const std::vector<TileWork>& tiles) const {
  Box3 bounds;
  for (const TileWork& work : tiles)
    for_each_active_block(work, surface_.roi, [&](Box3 cells) { bounds = unite(bounds, cells); });
  return bounds;
}

void VolumePass::extract_array(CpuExtractor& extractor, Progress& progress) {
  const std::uint64_t tile_bytes = kTileVolume * samples_.lattice.sample_bytes();
  progress.begin("extracting", tiles_.size() * tile_bytes);
  const std::size_t at_once =
      std::min(kMaxTilesAtOnce, kTilesOfThread * static_cast<std::size_t>(workers_.threads()));
  for (std::size_t i = 0; i < tiles_.size(); i += at_once) {
    const auto some = std::span(tiles_).subspan(i, std::min(at_once, tiles_.size() - i));
    workers_.execute([&] { extractor.extract(some, *samples_.array); });
    progress.advance(some.size() * tile_bytes);
  }
  progress.end();
}

/// Calls f(tiles) for the regions that may have a part of the surface, in Morton order.
template <class F>
void VolumePass::for_each_region(F&& f) const {
  const Int3 edge = kOne * region_tiles_;
  std::vector<TileWork> active;
  for_each_morton(ceil_div(samples_.lattice.tiles(), edge), [&](Int3 p) {
    const Box3 region{p * edge, (p + kOne) * edge};
    const Box3 tiles = intersect(region, tiles_of_roi());
    if (tiles.empty()) return;
    active.clear();
    const bool is_known = samples_.is_known(tiles);
    if (is_known) append_tiles(region, active);
    if (!is_known || !active.empty()) f(tiles);
  });
}

/// Reads a region while the one before is extracted.
void VolumePass::extract_regions(CpuExtractor& extractor, Progress& progress) {
  std::uint64_t bytes = 0;
  for_each_region([&](Box3 tiles) { bytes += sample_bytes(tiles); });
  progress.begin("extracting", bytes);
  RegionReader reader(samples_.read, samples_.concurrent, samples_.read_type, workers_);
  const Index reach = sample_reach(surface_);
  std::optional<Box3> reading;
  const auto proceed = [&](std::optional<Box3> next) {
    const std::optional<SampleArray> read = reading ? std::optional(reader.take()) : std::nullopt;
    if (next) reader.begin(samples_of(*next, reach, samples_.lattice));
    if (read) {
      extract_region(extractor, *read, *reading);
      progress.advance(sample_bytes(*reading));
    }
    reading = next;
  };
  for_each_region(proceed);
  proceed(std::nullopt);
  progress.end();
}

void VolumePass::extract_region(CpuExtractor& extractor, const SampleArray& read, Box3 tiles) {
  const ArraySamples samples(samples_.lattice.extent, read, samples_.missing, samples_.use);
  if (!samples_.is_known(tiles)) {
    workers_.execute([&] {
      const std::vector<Box3> rows = cut(tiles, {region_tiles_, 1, 1});
      tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
        samples_.ranges->scan(samples, blocks_of(rows[i], samples_.lattice));
      });
    });
    samples_.set_known(tiles);
  }
  std::vector<TileWork> active;
  const Int3 corner = floor_div(tiles.lo, kOne * region_tiles_) * region_tiles_;
  append_tiles({corner, corner + kOne * region_tiles_}, active);
  std::erase_if(active, [&](const TileWork& work) { return !tiles.contains(work.tile); });
  if (!active.empty()) workers_.execute([&] { extractor.extract(active, samples); });
}

/// Finds what is known before the first sample of a surface.
void VolumePass::prepare(Progress& progress) {
  if (samples_.array) find_ranges(progress);
  const bool known = samples_.is_known(tiles_of_roi());
  // Samples that are not known yet may be NaN.
  surface_.may_have_nan =
      is_floating(samples_.lattice.type) && (samples_.ranges->has_nan() || !known);
  if (known) tiles_ = active_tiles();
}

void VolumePass::extract(CpuExtractor& extractor, Progress& progress) {
  if (samples_.array)
    extract_array(extractor, progress);
  else
    extract_regions(extractor, progress);
}

SurfaceReport VolumePass::run(MeshSink& sink, Progress& progress) {
  plan(true, sink.memory());
  prepare(progress);
  sink.begin(mesh_header(samples_.transform, samples_.lattice.extent, surface_.normals,
                         active_cells(tiles_)));
  CpuExtractor extractor(samples_.lattice, surface_, limits_, &sink, spaces_);
  extract(extractor, progress);
  extractor.finish();
  sink.finish();
  return extractor.report();
}

SurfaceReport VolumePass::run(Mesh& mesh, Progress& progress) {
  plan(false, 0);
  prepare(progress);
  CpuExtractor extractor(samples_.lattice, surface_, limits_, nullptr, spaces_);
  {
    LentMesh lent(mesh, extractor.mesh());
    reserve(count_blocks(tiles_), surface_.normals, extractor.mesh());
    extract(extractor, progress);
    lent.complete();
  }
  mesh.unit = unit_name(samples_.transform.unit);
  return extractor.report();
}

}  // namespace isobrick
