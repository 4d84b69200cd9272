#include "isobrick/gpu/resident_launcher.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/gpu/search_kernel.h"
#include "isobrick/gpu/supported.h"
#include "isobrick/gpu/tile_index.h"
#include "isobrick/surface/world_map.h"

namespace isobrick::gpu {
namespace {

/// How often the host looks at a report before it asks the driver whether all is well.
constexpr std::uint32_t kLooks = 4096;

/// Row tables that few tiles have from the beginning, 4.4 MiB.
constexpr std::uint32_t kTablesAtFirst = 1024;

SurfaceOptions checked(SurfaceOptions options, const Lattice& lattice) {
  check_supported(lattice.type, options);
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
};

ResidentLauncher::ResidentLauncher(DeviceVolume::Impl& volume, const SurfaceOptions& options,
                                   const ResidentTuning& tuning)
    : volume_(volume),
      options_(checked(options, volume.lattice)),
      search_(tuning.search),
      shapes_(launch_shapes(kernel_of(volume.lattice.type, options), tuning.threads)),
      cases_(1, volume.stream),
      items_(volume.tile_count, volume.stream),
      slot_of_tile_(volume.tile_count, volume.stream),
      order_(volume.tile_count * slabs() * (are_few() ? 2 : 1), volume.stream),
      words_(sizeof(Counters) + sizeof(unsigned long long) * search_blocks(), volume.stream),
      standing_(tuning.patience, volume.stream) {
  const cudaStream_t stream = volume.stream.get();
  const CaseTable table = make_case_table(world_map(options_.transform, options_.inside).mirrored);
  check(cudaMemcpyAsync(cases_.data(), &table, sizeof table, cudaMemcpyHostToDevice, stream));
  check(cudaMemsetAsync(words_.data(), 0, words_.bytes(), stream));
  if (are_few()) {
    make_row_tables(std::min(volume.tile_count, kTablesAtFirst) * slabs());
    check(cudaMemsetAsync(order_.data(), 0, order_.bytes(), stream));
    make_host_search();
  } else if (const auto kind = index_kind_of(search_)) {
    index_.emplace(index_tiles(volume, *kind));
  }
  volume.stream.wait();
}

ResidentLauncher::~ResidentLauncher() {
  if (volume_.standing == this) volume_.standing = nullptr;
  // What goes now is read and written by launches, if there is a driver still.
  const cudaStream_t stream = volume_.stream.get();
  if (cudaStreamQuery(stream) != cudaErrorNotReady) return;
  dismiss();
  (void)cudaStreamSynchronize(stream);
}

void ResidentLauncher::dismiss() {
  if (volume_.standing && volume_.standing != this)
    volume_.standing->standing_.dismiss(volume_.standing->launches_ + 1);
  standing_.dismiss(launches_ + 1);
}

/// So few tiles need no launch of their own to find the active ones.
bool ResidentLauncher::are_few() const {
  return volume_.tile_count <= (index_kind_of(search_) ? kMostThroughIndex : kMostCandidates);
}

/// Parts of a tile that may have a block each.
std::uint32_t ResidentLauncher::slabs() const {
  return volume_.tile_count <= kMostInSlabs ? kSlabsOfTile : 1;
}

std::size_t ResidentLauncher::search_blocks() const {
  return (volume_.tile_count + kTilesOfSearchBlock - 1) / kTilesOfSearchBlock;
}

/// Of the tiles that have a cell in the region of interest; empty ones of others.
std::vector<ValueRange<double>> ResidentLauncher::ranges_to_search() const {
  std::vector<ValueRange<double>> ranges = volume_.ranges_here;
  const bool uncut = options_.roi == volume_.lattice.box();
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const Int3 origin = volume_.tiles_here[i] * Index{32};
    const Int3 lo = max(options_.roi.lo, origin),
               last = min(options_.roi.hi - Int3{1, 1, 1}, origin + Int3{32, 32, 32});
    if (!uncut && (last.x <= lo.x || last.y <= lo.y || last.z <= lo.z))
      ranges[i] = {};
    else if (search_ == TileSearch::none)
      ranges[i] = {-HUGE_VAL, HUGE_VAL};
  }
  return ranges;
}

void ResidentLauncher::make_host_search() {
  const std::vector<Int3>& tiles = volume_.tiles_here;
  if (const auto kind = index_kind_of(search_))
    host_search_.emplace(tiles, ranges_to_search(), *kind, volume_.lattice.tiles());
  else
    host_search_.emplace(tiles, ranges_to_search());
}

/// Then no tile is stabbed, but by brute force all are taken.
bool ResidentLauncher::is_above_all_samples(double isovalue) const {
  return visit_device_scalar(volume_.lattice.type, [&](auto tag) {
    return Threshold<typename decltype(tag)::type>(isovalue).none;
  });
}

void ResidentLauncher::make_row_tables(std::uint32_t count) {
  if (count <= row_tables_.size()) return;
  dismiss();
  row_tables_ = {};
  if (are_few()) count = volume_.tile_count * slabs();  // it comes among launches
  row_tables_ = DeviceBuffer<RowTable>(count, volume_.stream);
  check(cudaMemsetAsync(row_tables_.data(), 0, row_tables_.bytes(), volume_.stream.get()));
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
  SearchParams p{};
  p.test = test_of(search_);
  p.uncut = options_.roi == volume_.lattice.box();
  if (index_) {
    index_->search(isovalue, volume_.stream);
    p.mask = index_->mask();
  }
  p.tiles = volume_.tiles.data();
  p.ranges = volume_.ranges.data();
  p.count = volume_.tile_count;
  const TileParams t = volume_.params();
  std::memcpy(p.grid, t.tiles, sizeof p.grid);
  set_region(p);
  p.isovalue = isovalue;
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

/// Asks the launch that stands by, if it can do it. False: there must be a new one.
bool ResidentLauncher::ask_standing(double isovalue, const FoundTiles& found) {
  if (found.count > kMostActiveInSlabs || found.count * slabs() > standing_.blocks()) return false;
  std::uint32_t threshold = 0;
  visit_device_scalar(volume_.lattice.type, [&](auto tag) {
    const auto value = Threshold<typename decltype(tag)::type>(isovalue).value;
    std::memcpy(&threshold, &value, sizeof value);
  });
  standing_.ask(launches_ + 1, threshold, static_cast<float>(isovalue), found);
  ++epoch_;
  ++launches_;
  return true;
}

/// What the launch does when it has made the mesh.
void ResidentLauncher::say_end(TileParams& p) const {
  p.end.report = report_.on_device();
  p.end.launch = launches_ + 1;
  p.order = order_.data();
  if (are_few()) {  // two sets that take turns
    p.end.next_items = volume_.tile_count * slabs();
    p.end.next_order = order_.data();
    (launches_ % 2 == 0 ? p.order : p.end.next_order) += p.end.next_items;
  }
  p.end.found = &counters()->found;
  p.end.done = &counters()->done;
  p.end.zero = &counters()->search_ticket;
  p.end.zero_words = static_cast<std::uint32_t>(
      (words_.bytes() - offsetof(Counters, search_ticket)) / sizeof(std::uint32_t));
}

/// Active tiles: the host has found them, or there will be about as many as last time.
std::uint32_t ResidentLauncher::expected_tiles(const FoundTiles& found,
                                               const DeviceCounts& last) const {
  return are_few() ? found.count : last.active_tiles;
}

void ResidentLauncher::launch_tiles(double isovalue, const MeshRoom& room, const FoundTiles& found,
                                    const DeviceCounts& last, bool stay) {
  LaunchShape shape = shape_of(found, last);
  TileParams p = volume_.params();
  if (are_few()) {
    p.candidates = {volume_.tiles.data(), volume_.order_of_tile.data(), volume_.tile_count};
    p.found = found.count;
    if (shape.slabs > 1)
      std::ranges::copy(found.tiles, p.found_tiles);
    else
      std::ranges::copy(found.words, p.found_words);
  } else {
    p.items = items_.data();
    p.item_count = &counters()->item_count;
    p.slot_of_tile = slot_of_tile_.data();
  }
  set_region(p);
  p.isovalue = isovalue;
  p.crossing = static_cast<float>(isovalue);
  p.world = world_map(options_.transform, options_.inside);
  p.diagonal = is_diagonal(p.world);
  p.row_tables = row_tables_.data();
  p.epoch = ++epoch_;
  p.number_start = &counters()->number_start;
  p.number_end = &counters()->number_end;
  p.positions = room.positions.data();
  p.normals = room.normals.data();
  p.triangles = room.triangles.data();
  p.vertex_capacity = room.positions.size();
  p.triangle_capacity = room.triangles.size();
  say_end(p);
  // Where all fit the device at a time it begins them in their order: none waits for one that
  // cannot begin.
  const bool one_each = shape.blocks == static_cast<int>(found.count) * shape.slabs;
  p.ticket = one_each ? nullptr : &counters()->extract_ticket;
  // Where they take several tiles each; before, time would be lost.
  if (expected_tiles(found, last) > 2u * static_cast<std::uint32_t>(shape.blocks))
    p.begin_at_once = static_cast<std::uint32_t>(shape.processors);
  const bool stays = stay && shape.slabs > 1;
  if (stays) {
    shape.blocks = std::min(shapes_.slabs.blocks, static_cast<int>(volume_.tile_count * slabs()));
    p.stand_by = standing_.prepare(launches_ + 1, volume_.stream);
  }
  launch_extraction(kernel_of(volume_.lattice.type, options_), p, cases_.data(), shape,
                    volume_.stream.get(), !are_few(), are_few() ? &graph_ : nullptr);
  ++launches_;  // only now: the sums of one that could not be launched are those of the next
  if (!stays) return;
  standing_.note_launch(static_cast<std::uint32_t>(shape.blocks));
  volume_.standing = this;
}

/// Of no more blocks than there are tiles, or slabs.
LaunchShape ResidentLauncher::shape_of(const FoundTiles& found, const DeviceCounts& last) const {
  const std::uint32_t expected = expected_tiles(found, last);
  // A cell has two triangles, give or take.
  const std::uint64_t cells = last.triangles / 2 / std::max(last.active_tiles, 1u);
  LaunchShape shape = slabs() > 1 ? shapes_.in_slabs(expected) : shapes_.of(expected, cells);
  const std::uint32_t most = are_few() ? found.count : volume_.tile_count;
  shape.blocks = std::min(shape.blocks, static_cast<int>(most) * shape.slabs);
  return shape;
}

bool ResidentLauncher::launch(double isovalue, const MeshRoom& room, const DeviceCounts& last,
                              bool stay) {
  if (is_above_all_samples(isovalue)) return false;
  FoundTiles found;
  if (host_search_) {
    found = host_search_->find(isovalue);
    if (found.count == 0) return false;
    if (stay && ask_standing(isovalue, found)) return true;
    dismiss();
    make_row_tables(found.count * slabs());
  } else {
    dismiss();
    launch_search(isovalue);
  }
  launch_tiles(isovalue, room, found, last, stay);
  return true;
}

std::optional<DeviceCounts> ResidentLauncher::read_report() const {
  std::uint64_t seen[LaunchReport::kWords];
  for (int i = 0; i < LaunchReport::kWords; ++i) {
    seen[i] = std::atomic_ref((*report_).words[i]).load(std::memory_order_relaxed);
    if (!LaunchWord::is_about(seen[i], launches_)) return std::nullopt;
  }
  return DeviceCounts{
      LaunchWord::value_of(seen[LaunchReport::kVertices]),
      LaunchWord::value_of(seen[LaunchReport::kTriangles]),
      static_cast<std::uint32_t>(LaunchWord::value_of(seen[LaunchReport::kActiveTiles]))};
}

/// The report comes some microseconds before an event would.
std::optional<DeviceCounts> ResidentLauncher::wait() {
  for (std::uint32_t looks = 1;; ++looks) {
    // Before the report is looked at, which nobody writes then any more.
    const bool over = looks % kLooks == 0 && volume_.stream.is_over();
    if (const auto counts = read_report()) return counts;
    if (standing_.has_left(*report_, launches_)) {
      standing_.note_left();
      --launches_;
      return std::nullopt;
    }
    if (over) throw Error("the device has ended an extraction without saying what it made");
  }
}

std::uint64_t ResidentLauncher::bytes() const {
  return cases_.bytes() + items_.bytes() + slot_of_tile_.bytes() + order_.bytes() + words_.bytes() +
         row_tables_.bytes() + standing_.bytes() + (index_ ? index_->bytes() : 0);
}

}  // namespace isobrick::gpu
