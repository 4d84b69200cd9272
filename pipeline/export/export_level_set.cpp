#include "pipeline/export/export_level_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <isobrick/estimate.h>
#include <isobrick/extract.h>
#include "bricks/level_set.h"
#include "core/budget_error.h"
#include "core/threshold.h"
#include "core/tile.h"
#include "io/volumes/vdb/vdb_level_set.h"
#include "pipeline/export/vdb_budget.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_reader.h"
#include "pipeline/stored_bricks.h"
#include "pipeline/workers.h"
#include "surface/cpu_extractor.h"

namespace isobrick::inline v0 {
namespace {

/// The extraction is not much faster with more.
constexpr std::uint64_t kExtractBytes = 256 * kMiB;

/// The most that the level set of active parts takes, with what it keeps of the triangles of a tile
/// or two.
std::uint64_t max_level_set_bytes(const ActiveParts& active, const VolumeInfo& info,
                                  int half_band) {
  const Vec3d spacing = info.transform.spacing;
  const double longest = std::max({spacing.x, spacing.y, spacing.z});
  std::uint64_t leaves_of_block = 1, leaves_of_triangle = 1;
  for (int axis = 0; axis < 3; ++axis) {
    // Voxels that a distance reaches on either side, and a leaf more where it begins within one.
    const double reach = std::ceil(half_band * longest / spacing[axis]) + 1;
    leaves_of_block *= static_cast<std::uint64_t>((kBlockEdge + 1 + 2 * reach) / 8) + 2;
    leaves_of_triangle *= static_cast<std::uint64_t>((2 + 2 * reach) / 8) + 2;
  }
  const MeshSize mesh = largest_mesh(active);
  const std::uint64_t tile = CpuExtractor::max_tile_output(false, Topology::consistent);
  const std::uint64_t vertices = std::min(mesh.vertices, tile / sizeof(Vec3f)),
                      triangles = std::min(mesh.triangles, tile / sizeof(Triangle));
  // Vectors may have twice the room that they need; the list of leaves and triangles that are near
  // each other is worked off when it is long.
  constexpr std::uint64_t listed = std::uint64_t{1} << 20, near_bytes = 16, touched_bytes = 48;
  const std::uint64_t near = std::min(triangles * leaves_of_triangle, listed + leaves_of_triangle);
  const std::uint64_t leaves = active.active_blocks * leaves_of_block;
  return vdb_grid_bytes(info.extent, leaves, sizeof(float)) +
         2 * (vertices * sizeof(Vec3d) + near * near_bytes +
              std::min(near, leaves) * touched_bytes);
}

/// How a budget is divided.
struct MemoryShares {
  std::uint64_t extraction = 0, grid = 0;
  std::uint64_t enough = 0, max_grid = 0;  ///< the whole and the grid's, so that it surely fits
};

MemoryShares divide(const StoreReader& store, const VolumeInfo& info,
                    const ExtractOptions& extraction, int half_band, std::uint64_t memory) {
  const std::uint64_t least = min_extract_memory(store, extraction, Indexing::chunk_local, 0);
  MemoryShares shares;
  shares.max_grid = max_level_set_bytes(count_active(store, extraction), info, half_band);
  shares.enough = least + kVdbLibraryBytes + shares.max_grid;
  if (memory < least + kVdbLibraryBytes + vdb_grid_bytes({1, 1, 1}, 1, sizeof(float)))
    refuse_vdb_budget(memory, shares.enough, shares.max_grid);
  // Larger pieces of mesh take more of the grid's share.
  const std::uint64_t spare = memory - std::min(memory, shares.enough);
  shares.extraction = std::max(least, std::min(least + spare / 2, kExtractBytes));
  shares.grid = memory - kVdbLibraryBytes - shares.extraction;
  return shares;
}

/// Measures distances from the triangles of a mesh.
class DistanceSink final : public MeshSink {
 public:
  explicit DistanceSink(VdbLevelSet& set) : set_(set) {}

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override { set_.add(chunk.positions, chunk.triangles); }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

 private:
  VdbLevelSet& set_;
};

/// Passes on which samples are inside, brick by brick. Only bricks of both kinds are read.
class InsideWriter {
 public:
  InsideWriter(const StoreReader& store, Box3 box, const ExportOptions& options, VdbLevelSet& set)
      : store_(store),
        level_(options.level),
        lattice_(store.info().levels[static_cast<std::size_t>(options.level)].lattice),
        box_(box),
        isovalue_(*options.isovalue),
        below_(options.inside.value_or(inside_of(store.info())) == Inside::below),
        set_(set),
        samples_(lattice_.brick_bytes()),
        inside_(static_cast<std::size_t>(volume(lattice_.brick))) {}

  /// The bricks of `bricks` that the box touches, whose ranges are read together.
  void put(Box3 bricks, Workers& workers) {
    const RangeTable ranges = store_.brick_ranges(level_, bricks);
    for_each_point(bricks, [&](Int3 b) {
      const ValueRange<double>& range = ranges.at(b);
      const bool none_above = range.empty() || range.hi < isovalue_;
      const bool none_below = range.empty() || range.lo >= isovalue_;
      if (below_ ? none_below : none_above) return;
      const Box3 part = intersect(lattice_.brick_box(b), box_);
      const Box3 out{part.lo - box_.lo, part.hi - box_.lo};
      // Ranges do not include NaN; such samples are outside.
      if ((below_ ? none_above : none_below) && !store_.info().may_have_nan)
        return set_.put_all_inside(out);
      workers.execute([&] { read_slab(store_, level_, part, samples_.data()); });
      compare(static_cast<std::size_t>(volume(part.extent())));
      set_.put_inside(out, inside_.data());
    });
  }

 private:
  void compare(std::size_t count) {
    visit_scalar(lattice_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      const Threshold<T> least(isovalue_);
      const T* samples = reinterpret_cast<const T*>(samples_.data());
      for (std::size_t i = 0; i < count; ++i) {
        const bool above = !least.none && samples[i] >= least.value;
        const bool is_number = samples[i] == samples[i];
        inside_[i] = below_ ? !above && is_number : above;
      }
    });
  }

  const StoreReader& store_;
  int level_;
  Lattice lattice_;
  Box3 box_;
  double isovalue_;
  bool below_;  ///< samples less than the isovalue are inside
  VdbLevelSet& set_;
  std::vector<std::byte> samples_;
  std::vector<std::uint8_t> inside_;
};

/// Takes the surface's distances, then which samples are inside.
void fill_level_set(const StoreReader& store, Box3 box, const ExportOptions& options,
                    const ExtractOptions& extraction, VdbLevelSet& set, Progress& progress) {
  DistanceSink sink(set);
  extract(store, extraction, sink, progress);

  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(options.level)].lattice;
  Workers workers(options.threads);
  InsideWriter signs(store, box, options, set);
  const Box3 bricks = lattice.bricks_of(box);
  const auto bytes = [&](Box3 b) {
    return static_cast<std::uint64_t>(volume(b.extent())) * lattice.brick_bytes();
  };
  progress.begin("signs", bytes(bricks));
  for_each_range_file(bricks, [&](Box3 part) {
    signs.put(part, workers);
    progress.advance(bytes(part));
  });
  progress.end();
}

}  // namespace

void export_level_set(const StoreReader& store, Box3 box, const VolumeInfo& info,
                      const ExportOptions& options, OutputFile& file, Progress& progress) {
  if (options.half_band < 1 || options.half_band > kWidestHalfBand)
    throw UsageError(fmt::format("a band of {} samples on either side: 1 to {} are possible",
                                 options.half_band, kWidestHalfBand));
  ExtractOptions extraction;
  extraction.isovalue = *options.isovalue;
  extraction.level = options.level;
  extraction.inside = options.inside;
  extraction.roi = box;
  extraction.threads = options.threads;
  extraction.backend = Backend::cpu;
  const MemoryShares shares = divide(store, info, extraction, options.half_band, options.memory);
  extraction.memory = shares.extraction;
  extraction.memory_of_others = options.memory - shares.extraction;
  const auto set =
      make_vdb_level_set_if_built(info, "surface", options.half_band, options.threads, shares.grid);
  try {
    fill_level_set(store, box, options, extraction, *set, progress);
  } catch (const BudgetError&) {
    refuse_vdb_budget(options.memory, shares.enough, shares.max_grid);
  }
  set->write(file);
}

}  // namespace isobrick
