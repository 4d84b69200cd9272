#include "gpu/stream/stream_device.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "gpu/memory/nvtx_range.h"
#include "gpu/stream/unpack_kernel.h"
#include "gpu/tile/block_groups.h"
#include "surface/cpu_extractor.h"
#include "surface/topology_tables.h"
#include "surface/world_map.h"

namespace isobrick::inline v0::gpu {

namespace {

/// Kernels read bricks where they lie in host memory.
void check_reads_host_memory() {
  int device = 0;
  check(cudaGetDevice(&device));
  if (!reads_host_memory(device))
    throw Error("the GPU cannot read the host's memory in place; use --backend cpu");
}

}  // namespace

StreamDevice::StreamDevice(const Lattice& lattice, const SurfaceOptions& options,
                           const StreamSizes& sizes, BrickPool* pool)
    : lattice_(lattice), options_(options), pool_(pool) {
  if (!pool_) check_reads_host_memory();
  for (StreamSizes s = sizes; !allocate(s);
       s = stream_sizes(lattice, options, std::max(1u, s.tiles / 2), kMinInFlight, s.pool))
    if (s.tiles == 1 && s.in_flight == kMinInFlight)
      throw Error(fmt::format(
          "the GPU has no {} bytes of free memory, which a single tile takes; use --backend cpu",
          s.device_bytes));
  shapes_ = launch_shapes(kernel_of(lattice.type, options));
}

StreamDevice::~StreamDevice() {
  for (const Stream* stream : {&upload_, &kernel_, &download_})
    (void)cudaStreamSynchronize(stream->get());
}

bool StreamDevice::allocate(const StreamSizes& sizes) {
  try {
    memory_ = DeviceBuffer<std::byte>(sizes.device_bytes - pool_device_bytes(lattice_, sizes.pool));
  } catch (const OutOfDeviceMemory&) {
    return false;
  }
  Arena arena(memory_.data(), memory_.size());
  sizes_ = sizes;
  layout_ = StagingLayout(sizes.tiles, sizes.tile_bricks, has_samples(options_));
  in_flight_.clear();
  const auto in_flight = static_cast<std::size_t>(sizes.in_flight);
  staging_ = PinnedBuffer<std::byte>(in_flight * sizes.staging_bytes);
  totals_ = PinnedBuffer<SurfaceTotals>(in_flight);
  for (std::size_t i = 0; i < in_flight; ++i) {
    auto launch = std::make_unique<InFlightLaunch>();
    launch->staging = staging_.data() + i * sizes.staging_bytes;
    launch->totals = &totals_[i];
    launch->device = arena.take<std::byte>(sizes.staging_bytes);
    launch->bricks = arena.take<std::byte>(sizes.sent_bricks * lattice_.brick_bytes());
    launch->mesh = MeshArrays::take(arena, sizes.vertices, sizes.triangles, options_.normals);
    in_flight_.push_back(std::move(launch));
  }
  tile_blocks_ = arena.take<std::byte>(sizes.tile_block_bytes);
  cases_ = arena.take<CaseTable>(1);
  number_ends_ = arena.take<unsigned long long>(kEnds + 1);
  params_.row_tables = arena.take<RowTable>(sizes.slots);
  params_.on_samples = sample_params(lattice_.type, options_);
  if (has_samples(options_)) {
    params_.on_samples.tables = arena.take<SampleTable>(sizes.slots);
    params_.on_samples.work = arena.take<SampleWork>(sizes.sample_blocks);
  }
  if (options_.topology == Topology::trilinear) {
    auto* tables = arena.take<TopologyTables>(1);
    check(cudaMemcpyAsync(tables, &topology_tables(), sizeof(TopologyTables),
                          cudaMemcpyHostToDevice, kernel_.get()));
    params_.trilinear = {arena.take<TrilinearWork>(sizes.trilinear_blocks), tables};
  }
  check(cudaMemsetAsync(number_ends_, 0, (kEnds + 1) * sizeof(unsigned long long), kernel_.get()));
  check(cudaMemsetAsync(params_.row_tables, 0, sizes.slots * sizeof(RowTable), kernel_.get()));
  const WorldMap world = world_map(options_.transform, options_.inside);
  const CaseTable cases = make_case_table(world.mirrored);
  check(cudaMemcpyAsync(cases_, &cases, sizeof cases, cudaMemcpyHostToDevice, kernel_.get()));
  kernel_.wait();
  params_.tile_blocks = tile_blocks_;
  for (int axis = 0; axis < 3; ++axis) {
    params_.tiles[axis] = static_cast<std::int32_t>(lattice_.tiles()[axis]);
    params_.extent[axis] = static_cast<std::int32_t>(lattice_.extent[axis]);
    params_.roi_lo[axis] = static_cast<std::int32_t>(options_.roi.lo[axis]);
    params_.roi_hi[axis] = static_cast<std::int32_t>(options_.roi.hi[axis]);
  }
  params_.isovalue = options_.isovalue;
  params_.world = world;
  params_.diagonal = is_diagonal(world);
  params_.unwelded = options_.indexing == Indexing::chunk_local;
  params_.vertex_capacity = sizes.vertices;
  params_.triangle_capacity = sizes.triangles;
  return true;
}

void StreamDevice::launch_kernels(InFlightLaunch& launch, std::uint32_t first, std::uint32_t count,
                                  const unsigned long long* number_start,
                                  unsigned long long* number_end, bool tables_known) {
  auto* header = reinterpret_cast<LaunchHeader*>(launch.device);
  TileParams p = params_;
  p.items = reinterpret_cast<const TileItem*>(launch.device + layout_.items) + first;
  p.links = reinterpret_cast<const TileLinks*>(launch.device + layout_.links) + first;
  p.on_samples.neighbours =
      reinterpret_cast<const TileNeighbours*>(launch.device + layout_.neighbours) + first;
  p.on_samples.left_out = &header->totals.left_out;
  p.order = reinterpret_cast<OrderState*>(launch.device + layout_.order);
  p.item_count = &header->item_count;
  p.ticket = &header->ticket;
  p.totals = &header->totals;
  p.tables_known = tables_known;
  p.epoch = ++epoch_;
  p.number_start = params_.unwelded ? number_ends_ + kEnds : number_start;
  p.number_end = params_.unwelded ? &header->number_end : number_end;
  if (launch.only_counts) p.vertex_capacity = p.triangle_capacity = 0;
  p.positions = launch.mesh.positions;
  p.normals = launch.mesh.normals;
  p.triangles = launch.mesh.triangles;
  UnpackParams u{};
  u.items = p.items;
  u.links = p.links;
  u.count = count;
  u.boxes = reinterpret_cast<const BrickBox*>(launch.device + layout_.boxes) + first;
  u.bricks = reinterpret_cast<const std::uint64_t*>(launch.device + layout_.bricks) +
             std::size_t{first} * sizes_.tile_bricks;
  u.tile_bricks = sizes_.tile_bricks;
  u.reach = static_cast<int>(sample_reach(options_));
  u.corners = options_.may_have_nan || has_samples(options_);
  for (int axis = 0; axis < 3; ++axis) {
    u.brick[axis] = static_cast<std::int32_t>(lattice_.brick[axis]);
    u.extent[axis] = p.extent[axis];
  }
  u.fill_value = options_.fill_value;
  u.tile_blocks = tile_blocks_;
  launch.unpack_begin.record(kernel_);
  {
    const NvtxRange range("unpack tiles");
    launch_unpack(lattice_.type, u, kernel_.get());
  }
  launch.unpacked.record(kernel_);
  const NvtxRange range("extract tiles");
  LaunchShape shape = shapes_.of(count);
  shape.blocks = std::min(shape.blocks, static_cast<int>(count));
  shape.launch(shape, p, cases_, kernel_.get());
  check(cudaMemcpyAsync(launch.totals, &header->totals, sizeof(SurfaceTotals),
                        cudaMemcpyDeviceToHost, kernel_.get()));
  launch.extracted.record(kernel_);
}

/// Neighbours in host memory are sent together.
void StreamDevice::send(InFlightLaunch& launch) {
  const NvtxRange range("upload");
  const std::size_t bytes = lattice_.brick_bytes();
  const std::vector<UploadedBrick>& sent = launch.use.sent;
  for (std::size_t first = 0, end = 0; first < sent.size(); first = end) {
    for (++end; end < sent.size() && sent[end].from == sent[end - 1].from + bytes;) ++end;
    check(cudaMemcpyAsync(launch.bricks + first * bytes, sent[first].from, (end - first) * bytes,
                          cudaMemcpyHostToDevice, upload_.get()));
  }
  check(cudaMemcpyAsync(launch.device, launch.staging, used_staging(launch), cudaMemcpyHostToDevice,
                        upload_.get()));
}

void StreamDevice::submit(InFlightLaunch& launch, std::uint64_t number) {
  const NvtxRange range("submit launch");
  const std::lock_guard lock(launching_);
  launch.upload_begin.record(upload_);
  send(launch);
  launch.uploaded.record(upload_);
  check(cudaStreamWaitEvent(kernel_.get(), launch.uploaded.get()));
  if (pool_) pool_->wait_on(kernel_);
  check(cudaStreamWaitEvent(kernel_.get(), launch.downloaded.get()));
  launch_kernels(launch, 0, launch.count, number_ends_ + number % kEnds,
                 number_ends_ + (number + 1) % kEnds, false);
}

void StreamDevice::submit_part(InFlightLaunch& launch, std::uint32_t first, std::uint32_t count,
                               std::uint64_t number_start) {
  const NvtxRange range("submit part of a launch");
  const std::lock_guard lock(launching_);
  auto* header = reinterpret_cast<LaunchHeader*>(launch.device);
  LaunchHeader& sent = *reinterpret_cast<LaunchHeader*>(launch.at(0));
  sent = {};
  sent.item_count = count;
  sent.number_start = number_start;
  check(cudaMemcpyAsync(header, &sent, sizeof sent, cudaMemcpyHostToDevice, kernel_.get()));
  check(
      cudaMemsetAsync(launch.device + layout_.order, 0, count * sizeof(OrderState), kernel_.get()));
  launch_kernels(launch, first, count, &header->number_start, &header->number_end, true);
}

std::vector<OrderState> StreamDevice::totals_of_tiles(InFlightLaunch& launch) {
  std::vector<OrderState> totals(launch.count);
  check(cudaMemcpyAsync(totals.data(), launch.device + layout_.order,
                        totals.size() * sizeof(OrderState), cudaMemcpyDeviceToHost,
                        download_.get()));
  download_.wait();
  // Tiles without a mesh never read the sums before them.
  OrderState before{0, 0};
  for (OrderState& t : totals)
    before = t = {std::max(before.vertices, t.vertices & kOrderMask),
                  std::max(before.triangles, t.triangles & kOrderMask)};
  return totals;
}

void StreamDevice::download(InFlightLaunch& launch, const MeshArrays& to, SurfaceTotals size) {
  const NvtxRange range("download");
  const auto copy = [&](void* host, const void* device, std::size_t bytes) {
    if (bytes > 0)
      check(cudaMemcpyAsync(host, device, bytes, cudaMemcpyDeviceToHost, download_.get()));
  };
  launch.download_begin.record(download_);
  copy(to.positions, launch.mesh.positions, size.vertices * sizeof(Vec3f));
  if (options_.normals) copy(to.normals, launch.mesh.normals, size.vertices * sizeof(Vec3f));
  copy(to.triangles, launch.mesh.triangles, size.triangles * sizeof(Triangle));
  launch.downloaded.record(download_);
}

}  // namespace isobrick::gpu
