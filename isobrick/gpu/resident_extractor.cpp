#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <optional>

#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/gpu/device_volume_impl.h"
#include "isobrick/gpu/host_search.h"
#include "isobrick/gpu/kernel_graph.h"
#include "isobrick/gpu/search_kernel.h"
#include "isobrick/gpu/supported.h"
#include "isobrick/gpu/tile_index.h"
#include "isobrick/gpu/tile_kernel.h"
#include "isobrick/surface/world_map.h"

namespace isobrick::gpu {
namespace {

/// Small words that kernels share.
struct Counters {
  std::uint32_t item_count, found;
  unsigned long long number_start, number_end;
  // From here on, with the sums of the search behind it, zeroed by the end of each launch.
  alignas(8) std::uint32_t search_ticket, extract_ticket, done, unused;
};

/// How often the host looks at a report before it asks the driver whether all is well.
constexpr std::uint32_t kLooks = 4096;

/// Mesh to expect of a tile before anything is known: a sheet across it, twice.
constexpr std::uint64_t kVerticesOfTile = 2500, kTrianglesOfTile = 5000;

}  // namespace

struct ResidentExtractor::Impl {
  DeviceVolume::Impl& volume;
  SurfaceOptions options;
  LaunchShapes shapes;
  std::uint32_t active = 0;  ///< tiles of the last launch
  double isovalue = 0;
  std::uint32_t epoch = 0;
  DeviceBuffer<CaseTable> cases;
  DeviceBuffer<TileItem> items;
  DeviceBuffer<std::uint32_t> slot_of_tile;
  DeviceBuffer<OrderState> order;
  DeviceBuffer<std::byte> words;  ///< Counters, then the sums of the search
  DeviceBuffer<RowTable> row_tables;
  DeviceBuffer<Vec3f> positions, normals;
  DeviceBuffer<Triangle> triangles;
  MappedHost<LaunchReport> report;
  std::uint32_t launches = 0;
  DeviceCounts made;  ///< by the last extraction
  Event start, end;
  TileSearch search;
  std::optional<SpanIndices> index;       ///< of the tiles, where the search is through one
  std::optional<HostSearch> host_search;  ///< where there is no index and tiles are few
  KernelGraph graph;

  Impl(DeviceVolume& v, const SurfaceOptions& o, const ResidentTuning& tuning)
      : volume(v.impl()),
        options(o),
        shapes(launch_shapes(kernel_of(volume.lattice.type, o), tuning.threads)),
        cases(1, volume.stream),
        items(volume.tile_count, volume.stream),
        slot_of_tile(volume.tile_count, volume.stream),
        order(volume.tile_count * slabs() * (are_few() ? 2 : 1), volume.stream),
        words(sizeof(Counters) + sizeof(unsigned long long) * search_blocks(), volume.stream),
        search(tuning.search) {
    if (const auto kind = index_kind_of(search)) index.emplace(index_tiles(volume, *kind));
    check_supported(volume.lattice.type, o);
    if (o.indexing != Indexing::welded)
      throw UsageError("a resident volume makes welded meshes only; use the CPU");
    options.roi = intersect(o.roi, volume.lattice.box());
    if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
    const CaseTable table = make_case_table(world_map(options.transform).mirrored);
    check(cudaMemcpyAsync(cases.data(), &table, sizeof table, cudaMemcpyHostToDevice,
                          volume.stream.get()));
    check(cudaMemsetAsync(words.data(), 0, words.bytes(), volume.stream.get()));
    if (are_few()) {
      make_row_tables(volume.tile_count * slabs());
      check(cudaMemsetAsync(order.data(), 0, order.bytes(), volume.stream.get()));
      if (!index) host_search.emplace(volume.tiles_here, ranges_to_search());
    }
    volume.stream.wait();
  }

  /// So few tiles need no launch of their own to find the active ones.
  bool are_few() const { return volume.tile_count <= kMostCandidates; }
  /// Of the tiles that have a cell in the region of interest; empty ones of others.
  std::vector<ValueRange<double>> ranges_to_search() const {
    std::vector<ValueRange<double>> ranges = volume.ranges_here;
    const bool uncut = options.roi == volume.lattice.box();
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const Int3 origin = volume.tiles_here[i] * Index{32};
      const Int3 lo = max(options.roi.lo, origin),
                 last = min(options.roi.hi - Int3{1, 1, 1}, origin + Int3{32, 32, 32});
      if (!uncut && (last.x <= lo.x || last.y <= lo.y || last.z <= lo.z))
        ranges[i] = {};
      else if (search == TileSearch::none)
        ranges[i] = {-HUGE_VAL, HUGE_VAL};
    }
    return ranges;
  }
  /// Then no tile is stabbed, but by brute force all are taken.
  bool is_above_all_samples() const {
    return visit_device_scalar(volume.lattice.type, [&](auto tag) {
      return Threshold<typename decltype(tag)::type>(isovalue).none;
    });
  }
  /// Parts of a tile that may have a block each.
  std::uint32_t slabs() const { return volume.tile_count <= kMostInSlabs ? kSlabsOfTile : 1; }
  std::size_t search_blocks() const {
    return (volume.tile_count + kTilesOfSearchBlock - 1) / kTilesOfSearchBlock;
  }
  Counters* counters() const { return reinterpret_cast<Counters*>(words.data()); }

  /// All tiles, the index searched where there is one.
  TileCandidates candidates() {
    TileCandidates c{};
    c.test = test_of(search);
    c.uncut = options.roi == volume.lattice.box();
    if (index) {
      index->search(isovalue, volume.stream);
      c.mask = index->mask();
    }
    c.tiles = volume.tiles.data();
    c.order_of_tile = volume.order_of_tile.data();
    c.ranges = volume.ranges.data();
    c.count = volume.tile_count;
    return c;
  }

  void launch_search() {
    SearchParams p{};
    p.candidates = candidates();
    const TileParams t = volume.params();
    std::memcpy(p.grid, t.tiles, sizeof p.grid);
    for (int axis = 0; axis < 3; ++axis) {
      p.roi_lo[axis] = static_cast<std::int32_t>(options.roi.lo[axis]);
      p.roi_hi[axis] = static_cast<std::int32_t>(options.roi.hi[axis]);
    }
    p.isovalue = isovalue;
    p.items = items.data();
    p.found = &counters()->found;
    p.item_count = &counters()->item_count;
    p.item_room = static_cast<std::uint32_t>(row_tables.size());
    p.slot_of_tile = slot_of_tile.data();
    p.order = order.data();
    p.sums = reinterpret_cast<unsigned long long*>(counters() + 1);
    p.ticket = &counters()->search_ticket;
    gpu::launch_search(volume.lattice.type, p, volume.stream.get());
  }

  void launch_tiles(const FoundTiles& found) {
    TileParams p = volume.params();
    if (are_few()) {
      p.candidates = candidates();
      p.found = found;
    } else {
      p.items = items.data();
      p.item_count = &counters()->item_count;
      p.slot_of_tile = slot_of_tile.data();
    }
    for (int axis = 0; axis < 3; ++axis) {
      p.roi_lo[axis] = static_cast<std::int32_t>(options.roi.lo[axis]);
      p.roi_hi[axis] = static_cast<std::int32_t>(options.roi.hi[axis]);
    }
    p.isovalue = isovalue;
    p.crossing = static_cast<float>(isovalue);
    p.world = world_map(options.transform);
    p.diagonal = is_diagonal(p.world);
    p.row_tables = row_tables.data();
    p.ticket = &counters()->extract_ticket;
    p.epoch = ++epoch;
    p.number_start = &counters()->number_start;
    p.number_end = &counters()->number_end;
    p.positions = positions.data();
    p.normals = normals.data();
    p.triangles = triangles.data();
    p.vertex_capacity = positions.size();
    p.triangle_capacity = triangles.size();
    p.end.report = report.on_device();
    p.end.launch = launches + 1;
    p.order = order.data();
    if (are_few()) {  // two sets that take turns
      p.end.next_items = volume.tile_count * slabs();
      p.end.next_order = order.data();
      (launches % 2 == 0 ? p.order : p.end.next_order) += p.end.next_items;
    }
    p.end.found = &counters()->found;
    p.end.done = &counters()->done;
    p.end.zero = &counters()->search_ticket;
    p.end.zero_words = static_cast<std::uint32_t>(
        (words.bytes() - offsetof(Counters, search_ticket)) / sizeof(std::uint32_t));
    const LaunchShape shape = shape_of(found);
    // All fit the device at a time, and it begins them in their order: none waits for one that
    // cannot begin.
    if (shape.blocks == static_cast<int>(found.count) * shape.slabs) p.ticket = nullptr;
    launch_extraction(kernel_of(volume.lattice.type, options), p, cases.data(), shape,
                      volume.stream.get(), !are_few(), are_few() ? &graph : nullptr);
    ++launches;  // only now: the sums of one that could not be launched are those of the next
  }

  /// Of no more blocks than there are tiles, or slabs.
  LaunchShape shape_of(const FoundTiles& found) const {
    const bool known = found.count != FoundTiles::kNotSearched;
    const std::uint32_t expected = known ? found.count : active;
    // A cell has two triangles, give or take.
    const std::uint64_t cells = made.triangles / 2 / std::max(made.active_tiles, 1u);
    LaunchShape shape =
        known && slabs() > 1 ? shapes.in_slabs(expected) : shapes.of(expected, cells);
    const std::uint32_t most = known ? found.count : volume.tile_count;
    shape.blocks = std::min(shape.blocks, static_cast<int>(most) * shape.slabs);
    return shape;
  }

  /// Buffers for a mesh of that size. What they held is lost.
  void make_room(std::uint64_t vertices, std::uint64_t triangle_count) {
    const Stream& stream = volume.stream;
    if (vertices > positions.size()) {
      positions = {};
      positions = DeviceBuffer<Vec3f>(vertices, stream);
      normals = {};
      if (options.normals) normals = DeviceBuffer<Vec3f>(vertices, stream);
    }
    if (triangle_count > triangles.size()) {
      triangles = {};
      triangles = DeviceBuffer<Triangle>(triangle_count, stream);
    }
  }

  void make_row_tables(std::uint32_t count) {
    if (count <= row_tables.size()) return;
    row_tables = {};
    row_tables = DeviceBuffer<RowTable>(count, volume.stream);
    check(cudaMemsetAsync(row_tables.data(), 0, row_tables.bytes(), volume.stream.get()));
    epoch = 0;
  }

  /// Waits for the last launch. Its report comes some microseconds before an event would.
  DeviceCounts wait_for_report() const {
    std::uint64_t seen[LaunchReport::kWords];
    const auto is_there = [&] {
      for (int i = 0; i < LaunchReport::kWords; ++i) {
        seen[i] = std::atomic_ref((*report).words[i]).load(std::memory_order_relaxed);
        if (!LaunchReport::is_about(seen[i], launches)) return false;
      }
      return true;
    };
    for (std::uint32_t looks = 1; !is_there(); ++looks) {
      if (looks % kLooks != 0) continue;
      const cudaError_t state = cudaStreamQuery(volume.stream.get());
      if (state == cudaErrorNotReady) continue;
      check(state);
      if (!is_there())
        throw Error("the device has ended an extraction without saying what it made");
    }
    return {LaunchReport::value_of(seen[LaunchReport::kVertices]),
            LaunchReport::value_of(seen[LaunchReport::kTriangles]),
            static_cast<std::uint32_t>(LaunchReport::value_of(seen[LaunchReport::kActiveTiles]))};
  }

  DeviceCounts extract(double value) {
    if (std::isnan(value)) throw UsageError("the isovalue is not a number");
    isovalue = value;
    // Tiles that have no room are not begun: the first launch tells how many there are.
    for (;;) {
      if (!launch()) return made = {};
      const DeviceCounts seen = wait_for_report();
      active = seen.active_tiles;
      const bool begun = active <= row_tables.size();
      make_row_tables(active);
      if (!begun || (active > 0 && positions.size() == 0)) {
        make_room(kVerticesOfTile * active, kTrianglesOfTile * active);
        continue;
      }
      if (seen.vertices > std::numeric_limits<std::uint32_t>::max())
        throw Error(
            "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits cannot "
            "number; extract it in parts with --roi");
      if (seen.vertices <= positions.size() && seen.triangles <= triangles.size())
        return made = seen;
      make_room(seen.vertices, seen.triangles);
    }
  }

  /// False where it is known that there is nothing to make.
  bool launch() {
    if (is_above_all_samples()) return false;
    FoundTiles found;
    if (host_search) found = host_search->find(isovalue);
    if (found.count == 0) return false;
    if (!are_few()) launch_search();
    launch_tiles(found);
    return true;
  }

  void repeat() {
    start.record(volume.stream);
    launch();
    end.record(volume.stream);
  }
};

ResidentExtractor::ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                                     const ResidentTuning& tuning)
    : impl_(std::make_unique<Impl>(volume, options, tuning)) {}
ResidentExtractor::~ResidentExtractor() = default;

DeviceCounts ResidentExtractor::extract(double isovalue) { return impl_->extract(isovalue); }
void ResidentExtractor::repeat() { impl_->repeat(); }

float ResidentExtractor::milliseconds() {
  impl_->end.wait();
  return impl_->end.since(impl_->start);
}

void ResidentExtractor::download(MeshBuffer& mesh) const {
  const DeviceCounts made = impl_->made;
  impl_->volume.stream.wait();
  mesh.clear();
  mesh.positions.resize(made.vertices);
  mesh.triangles.resize(made.triangles);
  if (impl_->options.normals) mesh.normals.resize(made.vertices);
  const auto copy = [](void* to, const void* from, std::size_t bytes) {
    if (bytes > 0) check(cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost));
  };
  copy(mesh.positions.data(), impl_->positions.data(), made.vertices * sizeof(Vec3f));
  copy(mesh.normals.data(), impl_->normals.data(), mesh.normals.size() * sizeof(Vec3f));
  copy(mesh.triangles.data(), impl_->triangles.data(), made.triangles * sizeof(Triangle));
}

std::uint64_t ResidentExtractor::bytes() const {
  const Impl& i = *impl_;
  return i.cases.bytes() + i.items.bytes() + i.slot_of_tile.bytes() + i.order.bytes() +
         i.words.bytes() + i.row_tables.bytes() + i.positions.bytes() + i.normals.bytes() +
         i.triangles.bytes() + (i.index ? i.index->bytes() : 0);
}

}  // namespace isobrick::gpu
