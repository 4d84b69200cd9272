#include "gpu/resident/resident_launcher.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/threshold.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/resident/resident_sizes.h"
#include "gpu/search/search_kernel.h"
#include "gpu/tile/on_samples.h"
#include "surface/surface_extractor.h"
#include "surface/topology_tables.h"
#include "surface/world_map.h"

namespace isobrick::inline v0::gpu {
namespace {

/// How often the host reads a report before it queries the driver for errors.
constexpr std::uint32_t kReadsBetweenQueries = 4096;

/// Zeroed memory for a report, on the current device. It is kept for the next one: to pin a page
/// takes as long as to make a small mesh.
std::shared_ptr<PinnedBuffer<LaunchReport>> take_report() {
  using Report = PinnedBuffer<LaunchReport>;
  struct Kept {
    std::mutex mutex;
    std::map<int, std::vector<std::unique_ptr<Report>>> of_device;
  };
  static const auto kept = std::make_shared<Kept>();
  int device = 0;
  check(cudaGetDevice(&device));
  std::unique_ptr<Report> report;
  {
    const std::lock_guard lock(kept->mutex);
    auto& free = kept->of_device[device];
    if (!free.empty()) {
      report = std::move(free.back());
      free.pop_back();
    }
  }
  if (!report) report = std::make_unique<Report>(1);
  report->data()[0] = {};
  return {report.release(), [home = kept, device](Report* used) {
            const std::lock_guard lock(home->mutex);
            home->of_device[device].emplace_back(used);
          }};
}

SurfaceOptions checked(SurfaceOptions options, const Lattice& lattice) {
  if (options.indexing != Indexing::welded)
    throw UsageError("a resident volume makes welded meshes only; use the CPU");
  options.roi = intersect(options.roi, lattice.box());
  if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
  return options;
}

}  // namespace

/// Small words that kernels share.
struct ResidentLauncher::Counters {
  std::uint32_t item_count, found;
  unsigned long long number_start, number_end;
  // From here on, with the sums of the search behind it, zeroed by the end of each launch.
  alignas(8) std::uint32_t search_ticket, extract_ticket, done, unused;
  unsigned long long left_out;
};

ResidentLauncher::ResidentLauncher(DeviceVolume::Impl& volume, const SurfaceOptions& options,
                                   const ResidentTuning& tuning)
    : volume_(volume),
      options_(checked(options, volume.lattice)),
      tuning_(tuning),
      shapes_(launch_shapes(kernel_for(false))),
      cases_(1, volume.stream),
      items_(volume.tile_count, volume.stream),
      slot_of_tile_(volume.grid_tiles(), volume.stream),
      order_(volume.tile_count, volume.stream),
      words_(sizeof(Counters) + sizeof(unsigned long long) * search_blocks(), volume.stream),
      report_(take_report()) {
  const cudaStream_t stream = volume.stream.get();
  const CaseTable table = make_case_table(world_map(options_.transform, options_.inside).mirrored);
  check(cudaMemcpyAsync(cases_.data(), &table, sizeof table, cudaMemcpyHostToDevice, stream));
  check(cudaMemsetAsync(words_.data(), 0, words_.bytes(), stream));
  // Tiles that are not searched are never active.
  static_assert(kNone == 0xffffffffu);
  check(cudaMemsetAsync(slot_of_tile_.data(), 0xff, slot_of_tile_.bytes(), stream));
  int blocks = shapes_.shapes[0].blocks;
  if (has_samples(options_)) {
    on_samples_shapes_ = launch_shapes(kernel_for(true));
    const int on_samples = on_samples_shapes_->shapes[0].blocks;
    work_ = DeviceBuffer<SampleWork>(
        std::min(volume.tile_count, static_cast<std::uint32_t>(on_samples)), volume.stream);
    blocks = std::max(blocks, on_samples);
  }
  if (options_.topology == Topology::trilinear) {
    topology_ = DeviceBuffer<TopologyTables>(1, volume.stream);
    check(cudaMemcpyAsync(topology_.data(), &topology_tables(), topology_.bytes(),
                          cudaMemcpyHostToDevice, stream));
    trilinear_work_ = DeviceBuffer<TrilinearWork>(
        std::min(volume.tile_count, static_cast<std::uint32_t>(blocks)), volume.stream);
  }
  make_row_tables(std::min(volume.tile_count, kFirstRowTables));
}

TileKernel ResidentLauncher::kernel_for(bool on_samples) const {
  TileKernel kernel = kernel_of(volume_.lattice.type, options_);
  kernel.on_samples = on_samples;
  return kernel;
}

ResidentLauncher::~ResidentLauncher() {
  // A launch may still use what goes now.
  (void)cudaStreamSynchronize(volume_.stream.get());
}

std::size_t ResidentLauncher::search_blocks() const {
  return (volume_.tile_count + kTilesOfSearchBlock - 1) / kTilesOfSearchBlock;
}

/// Then no tile is active, but for caps; brute force would take all.
bool ResidentLauncher::is_above_all_samples(double isovalue) const {
  return visit_scalar(volume_.lattice.type, [&](auto tag) {
    return Threshold<typename decltype(tag)::type>(isovalue).none;
  });
}

void ResidentLauncher::make_row_tables(std::uint32_t count) {
  if (count <= row_tables_.size()) return;
  row_tables_ = {};
  row_tables_ = DeviceBuffer<RowTable>(count, volume_.stream);
  check(cudaMemsetAsync(row_tables_.data(), 0, row_tables_.bytes(), volume_.stream.get()));
  if (has_samples(options_)) {
    sample_tables_ = {};
    sample_tables_ = DeviceBuffer<SampleTable>(count, volume_.stream);
  }
  epoch_ = 0;
}

template <class Params>
void ResidentLauncher::set_region(Params& p) const {
  for (int axis = 0; axis < 3; ++axis) {
    p.roi_lo[axis] = static_cast<std::int32_t>(options_.roi.lo[axis]);
    p.roi_hi[axis] = static_cast<std::int32_t>(options_.roi.hi[axis]);
  }
}

void ResidentLauncher::launch_search(double isovalue) {
  const NvtxRange range("search");
  SearchParams p{};
  p.all = tuning_.brute_force;
  p.uncut = options_.roi == volume_.lattice.box();
  p.tiles = volume_.tiles.data();
  p.ranges = volume_.ranges.data();
  p.count = volume_.tile_count;
  const TileParams t = volume_.params();
  std::memcpy(p.grid, t.tiles, sizeof p.grid);
  set_region(p);
  p.isovalue = isovalue;
  p.cap = options_.cap;
  p.below = options_.inside == Inside::below;
  p.everywhere = options_.may_have_nan;
  p.items = items_.data();
  p.found = &counters()->found;
  p.item_count = &counters()->item_count;
  p.item_room = static_cast<std::uint32_t>(row_tables_.size());
  p.slot_of_tile = slot_of_tile_.data();
  p.order = order_.data();
  p.sums = reinterpret_cast<unsigned long long*>(counters() + 1);
  p.ticket = &counters()->search_ticket;
  gpu::launch_search(volume_.lattice.type, p, volume_.stream.get());
}

LaunchEnd ResidentLauncher::launch_end() const {
  return {.report = report_->on_device(),
          .launch = launches_ + 1,
          .found = &counters()->found,
          .blocks = volume_.array ? volume_.array->wanted() : nullptr,
          .done = &counters()->done,
          .zero = &counters()->search_ticket,
          .zero_words = static_cast<std::uint32_t>(
              (words_.bytes() - offsetof(Counters, search_ticket)) / sizeof(std::uint32_t))};
}

void ResidentLauncher::launch_tiles(double isovalue, const MeshRoom& room,
                                    const DeviceCounts& last) {
  const NvtxRange range("extract tiles");
  TileParams p = volume_.params();
  p.items = items_.data();
  p.item_count = &counters()->item_count;
  p.slot_of_tile = slot_of_tile_.data();
  set_region(p);
  p.isovalue = isovalue;
  p.world = world_map(options_.transform, options_.inside);
  p.diagonal = is_diagonal(p.world);
  p.row_tables = row_tables_.data();
  p.order = order_.data();
  p.ticket = &counters()->extract_ticket;
  p.epoch = ++epoch_;
  p.number_start = &counters()->number_start;
  p.number_end = &counters()->number_end;
  p.positions = room.positions.data();
  p.normals = room.normals.data();
  p.triangles = room.triangles.data();
  p.vertex_capacity = room.positions.size();
  p.triangle_capacity = room.triangles.size();
  p.end = launch_end();
  SurfaceOptions options = options_;
  options.isovalue = isovalue;
  p.on_samples = sample_params(volume_.lattice.type, options);
  p.on_samples.work = work_.data();
  p.on_samples.tables = sample_tables_.data();
  p.on_samples.left_out = &counters()->left_out;
  p.trilinear = {trilinear_work_.data(), topology_.data()};
  const LaunchShape shape = shape_for(isovalue, last);
  shape.launch(shape, p, cases_.data(), volume_.stream.get());
  ++launches_;  // only now: the sums of one that could not be launched are those of the next
}

/// There will be about as many active tiles as last time.
LaunchShape ResidentLauncher::shape_for(double isovalue, const DeviceCounts& last) const {
  // A cell has two triangles, give or take.
  const std::uint64_t cells = last.triangles / 2 / std::max(last.active_tiles, 1u);
  // Without a cap only isovalues that samples can equal need them.
  const bool on_samples =
      options_.cap || (on_samples_shapes_ && has_coincident(volume_.lattice.type, isovalue));
  const LaunchShapes& shapes = on_samples ? *on_samples_shapes_ : shapes_;
  LaunchShape shape = tuning_.shape ? *tuning_.shape : shapes.of(last.active_tiles, cells);
  shape.blocks = std::min(shape.blocks, static_cast<int>(volume_.tile_count));
  return shape;
}

bool ResidentLauncher::launch(double isovalue, const MeshRoom& room, const DeviceCounts& last) {
  if (volume_.tile_count == 0 || (!options_.cap && is_above_all_samples(isovalue))) return false;
  launch_search(isovalue);
  if (volume_.array)
    volume_.array->launch_load(items_.data(), &counters()->found, &counters()->item_count,
                               static_cast<int>(sample_reach(options_)));
  launch_tiles(isovalue, room, last);
  return true;
}

bool ResidentLauncher::read_report(DeviceCounts& counts, std::uint32_t& blocks) const {
  std::uint64_t words[LaunchReport::kWords];
  for (int i = 0; i < LaunchReport::kWords; ++i) {
    words[i] = std::atomic_ref(report_->data()->words[i]).load(std::memory_order_relaxed);
    if (!LaunchWord::is_about(words[i], launches_)) return false;
    words[i] = LaunchWord::value_of(words[i]);
  }
  counts = {words[LaunchReport::kVertices], words[LaunchReport::kTriangles],
            static_cast<std::uint32_t>(words[LaunchReport::kActiveTiles]),
            words[LaunchReport::kLeftOut]};
  blocks = static_cast<std::uint32_t>(words[LaunchReport::kBlocks]);
  return true;
}

/// The report comes some microseconds before an event would.
DeviceCounts ResidentLauncher::wait() {
  const NvtxRange range("wait for the report");
  for (std::uint32_t reads = 1;; ++reads) {
    // Before the report is read: afterwards nobody writes it any more.
    const bool over = reads % kReadsBetweenQueries == 0 && volume_.stream.is_over();
    if (DeviceCounts counts; read_report(counts, wanted_blocks_)) return counts;
    if (over) throw Error("the device ended an extraction without a report");
  }
}

bool ResidentLauncher::is_reported() const {
  DeviceCounts counts;
  std::uint32_t blocks = 0;
  return read_report(counts, blocks);
}

std::uint64_t ResidentLauncher::bytes() const {
  return cases_.bytes() + items_.bytes() + slot_of_tile_.bytes() + order_.bytes() + words_.bytes() +
         row_tables_.bytes() + sample_tables_.bytes() + work_.bytes() + trilinear_work_.bytes() +
         topology_.bytes() + (volume_.array ? volume_.array->bytes() : 0);
}

}  // namespace isobrick::gpu
