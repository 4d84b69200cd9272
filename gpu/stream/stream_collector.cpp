#include "gpu/stream/stream_collector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "core/morton.h"
#include "gpu/memory/nvtx_range.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Part of a launch's capacity that its mesh is meant to fill.
constexpr double kFill = 0.85;

double seconds_between(const Event& start, const Event& end) { return end.since(start) * 1e-3; }

}  // namespace

StreamCollector::StreamCollector(int cuda_device, StreamDevice& device, bool welded, bool normals,
                                 MeshSink& sink)
    : cuda_device_(cuda_device),
      device_(device),
      welded_(welded),
      normals_(normals),
      outputs_(cuda_device, output_chunks(device.sizes())),
      preferred_tiles_(device.sizes().tiles),
      writer_(sink) {
  for (std::size_t i = 0; i < kOutputs; ++i) free_outputs_.push_back(kOutputs - 1 - i);
  thread_ = std::thread([this] { run(); });
}

StreamCollector::~StreamCollector() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
  // When something went wrong a mesh may still be on its way to an output.
  device_.end_downloads();
}

void StreamCollector::wait_for_free_launch() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return error_ || busy_ < device_.sizes().in_flight; });
  if (error_) std::rethrow_exception(error_);
}

void StreamCollector::submitted(InFlightLaunch& launch) {
  {
    const std::lock_guard lock(mutex_);
    ++busy_;
    in_flight_.push_back(&launch);
  }
  changed_.notify_all();
}

std::uint32_t StreamCollector::preferred_tiles() const {
  const std::lock_guard lock(mutex_);
  return preferred_tiles_;
}

void StreamCollector::finish() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
  if (error_) std::rethrow_exception(error_);
  writer_.finish();
}

SurfaceReport StreamCollector::report() const {
  SurfaceReport report = report_;
  report.vertices -= vertices_before_;
  report.sink = writer_.report();
  return report;
}

void StreamCollector::run() {
  try {
    check(cudaSetDevice(cuda_device_));
    follow();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  changed_.notify_all();
}

void StreamCollector::follow() {
  for (;;) {
    // A mesh is handed on while the next one is downloaded, or nothing else is to do.
    InFlightLaunch* launch = next_submitted(!pending_);
    if (!launch && !pending_) return;
    std::optional<Pending> next;
    if (launch) next = collect(*launch);
    if (pending_) deliver(*pending_);
    pending_ = next;
  }
}

/// Null at the end, or when none is there and `wait` is not set.
InFlightLaunch* StreamCollector::next_submitted(bool wait) {
  std::unique_lock lock(mutex_);
  if (wait) changed_.wait(lock, [&] { return closed_ || !in_flight_.empty(); });
  if (stop_ || in_flight_.empty()) return nullptr;
  InFlightLaunch* launch = in_flight_.front();
  in_flight_.pop_front();
  return launch;
}

std::optional<StreamCollector::Pending> StreamCollector::collect(InFlightLaunch& launch) {
  const NvtxRange range("collect");
  launch.extracted.wait();
  const StreamSizes& sizes = device_.sizes();
  const SurfaceTotals size = launch.totals[0];
  ++report_.launches;
  report_.upload.seconds += seconds_between(launch.upload_begin, launch.uploaded);
  report_.upload.bytes += device_.sent_bytes(launch);
  report_.gather.seconds += seconds_between(launch.unpack_begin, launch.unpacked);
  report_.gather.bytes += launch.use.read_bytes;
  report_.kernel.seconds += seconds_between(launch.unpacked, launch.extracted);
  report_.kernel.bytes += launch.count * device_.tile_block_bytes() +
                          mesh_bytes({size.vertices, size.triangles}, normals_);
  check_numbers(size.vertices);
  if (places_) note_places(launch, launch.only_counts ? 0 : size.left_out);
  std::optional<Pending> next;
  if (launch.only_counts) {
    report_.vertices += size.vertices;
    vertices_before_ += size.vertices;
  } else if (size.vertices > sizes.vertices || size.triangles > sizes.triangles) {
    if (pending_) deliver(*pending_);
    pending_.reset();
    repeat_in_parts(launch);
  } else {
    report_.degenerate_triangles += size.left_out;
    if (size.vertices + size.triangles > 0) next = start_download(launch, size);
  }
  launch.samples.reset();
  release_launch(launch.count, size);
  return next;
}

/// The triangles left out are counted with the first tile.
void StreamCollector::note_places(InFlightLaunch& launch, std::uint64_t left_out) {
  const auto* items = reinterpret_cast<const TileItem*>(launch.at(device_.layout().items));
  OrderState before{0, 0};
  for (const OrderState& sums : device_.totals_of_tiles(launch)) {
    const TilePlace place{
        .code = morton_encode({items->x, items->y, items->z}),
        .first_vertex = static_cast<std::uint32_t>(report_.vertices + before.vertices),
        .vertices = static_cast<std::uint32_t>(sums.vertices - before.vertices),
        .triangles = static_cast<std::uint32_t>(sums.triangles - before.triangles),
        .degenerate = static_cast<std::uint32_t>(std::exchange(left_out, 0))};
    if (place.vertices > 0 || place.triangles > 0 || place.degenerate > 0) places_->place(place);
    before = sums;
    ++items;
  }
}

/// As many tiles at a time as fit, going by the sums that they passed on.
void StreamCollector::repeat_in_parts(InFlightLaunch& launch) {
  const std::vector<OrderState> sums = device_.totals_of_tiles(launch);
  const StreamSizes& sizes = device_.sizes();
  const std::uint64_t start = report_.vertices;
  OrderState before{0, 0};
  for (std::uint32_t first = 0; first < launch.count;) {
    std::uint32_t end = first + 1;
    while (end < launch.count && sums[end].vertices - before.vertices <= sizes.vertices &&
           sums[end].triangles - before.triangles <= sizes.triangles)
      ++end;
    device_.submit_part(launch, first, end - first, start + before.vertices);
    launch.extracted.wait();
    ++report_.launches;
    ++report_.repeats;
    report_.gather.seconds += seconds_between(launch.unpack_begin, launch.unpacked);
    report_.kernel.seconds += seconds_between(launch.unpacked, launch.extracted);
    const SurfaceTotals size = launch.totals[0];
    report_.degenerate_triangles += size.left_out;
    if (size.vertices + size.triangles > 0) deliver(start_download(launch, size));
    before = sums[end - 1];
    first = end;
  }
}

void StreamCollector::check_numbers(std::uint64_t more) const {
  if (welded_ && report_.vertices + more > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits "
        "cannot number; extract it by way of pieces (--resume), by regions (--roi) or as STL");
}

StreamCollector::Pending StreamCollector::start_download(InFlightLaunch& launch,
                                                         SurfaceTotals size) {
  Pending pending{&launch, take_output(), size, report_.vertices};
  device_.download(launch, output(pending.output), size);
  report_.vertices += size.vertices;
  report_.triangles += size.triangles;
  return pending;
}

void StreamCollector::deliver(const Pending& pending) {
  const NvtxRange range("deliver");
  pending.launch->downloaded.wait();
  report_.download.seconds +=
      seconds_between(pending.launch->download_begin, pending.launch->downloaded);
  report_.download.bytes += mesh_bytes({pending.size.vertices, pending.size.triangles}, normals_);
  const MeshArrays from = output(pending.output);
  const auto vertices = static_cast<std::size_t>(pending.size.vertices);
  const MeshChunk chunk{pending.first_vertex,
                        {from.positions, vertices},
                        {from.normals, normals_ ? vertices : 0},
                        {from.triangles, pending.size.triangles}};
  try {
    writer_.write(chunk, [this, index = pending.output] { give_output(index); });
  } catch (...) {
    give_output(pending.output);
    throw;
  }
}

std::size_t StreamCollector::take_output() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !free_outputs_.empty(); });
  const std::size_t index = free_outputs_.back();
  free_outputs_.pop_back();
  return index;
}

MeshArrays StreamCollector::output(std::size_t index) {
  const StreamSizes& sizes = device_.sizes();
  Arena chunk(outputs_.locked(index), sizes.output_bytes);
  return MeshArrays::take(chunk, sizes.vertices, sizes.triangles, normals_);
}

void StreamCollector::give_output(std::size_t output) {
  {
    const std::lock_guard lock(mutex_);
    free_outputs_.push_back(output);
  }
  changed_.notify_all();
}

void StreamCollector::release_launch(std::uint32_t tiles, SurfaceTotals size) {
  const StreamSizes& sizes = device_.sizes();
  const auto fitting = [&](std::uint64_t capacity, std::uint64_t made) {
    return kFill * static_cast<double>(capacity) * tiles /
           static_cast<double>(std::max<std::uint64_t>(made, 1));
  };
  const double preferred =
      std::min(fitting(sizes.vertices, size.vertices), fitting(sizes.triangles, size.triangles));
  {
    const std::lock_guard lock(mutex_);
    --busy_;
    preferred_tiles_ =
        static_cast<std::uint32_t>(std::clamp(preferred, 1.0, static_cast<double>(sizes.tiles)));
  }
  changed_.notify_all();
}

}  // namespace isobrick::gpu
