#include <isobrick/device_volume.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

#include <isobrick/error.h>
#include "core/morton.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/memory/pool_memory.h"
#include "gpu/resident/device_volume_impl.h"
#include "gpu/search/search_kernel.h"
#include "gpu/tile/tile_block.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Bytes of samples that are gathered while the ones before are copied.
constexpr std::size_t kStagingBytes = std::size_t{32} << 20;

std::vector<Int3> all_tiles(const Lattice& lattice, bool in_morton_order) {
  std::vector<Int3> tiles;
  const auto add = [&](Int3 t) { tiles.push_back(t); };
  if (in_morton_order)
    for_each_morton(lattice.tiles(), add);
  else
    for_each_point({{0, 0, 0}, lattice.tiles()}, add);
  return tiles;
}

}  // namespace

DeviceVolume::Impl::Impl(const Lattice& l, double fill, const DeviceTiles& wanted,
                         std::size_t staging_bytes, Stream s)
    : lattice(l), fill_value(fill), stream(std::move(s)) {
  if (volume(l.tiles()) >= kNone)
    throw UsageError("the volume has too many tiles to be resident on a device");
  tile_blocks = DeviceBuffer<std::byte>((wanted.loaded.size() + 1) * block_bytes(), stream);
  columns = DeviceBuffer<std::byte>((wanted.loaded.size() + 1) * kColumnSamples * l.sample_bytes(),
                                    stream);
  table_.assign(grid_tiles(), kNone);
  list_tiles(wanted.searched);
  staging_ = std::vector<Staging>(2);
  for (Staging& staging : staging_) {
    staging.blocks = PinnedBuffer<std::byte>(std::max(block_bytes(), staging_bytes));
    staging.copied.record(stream);
  }
  fill_tile_block(l.type, fill, staging_[0].blocks.data());
  check(cudaMemcpyAsync(tile_blocks.data(), staging_[0].blocks.data(), block_bytes(),
                        cudaMemcpyHostToDevice, stream.get()));
  staging_[0].copied.record(stream);
  if (wanted.loaded.empty()) complete();
}

DeviceVolume::Impl::Impl(const DeviceArray& samples)
    : lattice{samples.extent, {64, 64, 64}, samples.type},
      fill_value(0),
      stream(samples.stream, samples.memory ? samples.memory : pool_memory()) {
  if (volume(lattice.tiles()) >= kNone)
    throw UsageError("the array has too many tiles to be resident on a device");
  array.emplace(samples, lattice, stream);
  array->launch_ranges();
  list_tiles(all_tiles(lattice, true));  // while the device reads
  has_nan = array->finish_ranges(tiles.data(), ranges.data());
}

DeviceVolume::Impl::~Impl() {
  // Samples may still be on their way from what goes now.
  (void)cudaStreamSynchronize(stream.get());
}

void DeviceVolume::Impl::list_tiles(std::span<const Int3> searched) {
  tile_count = static_cast<std::uint32_t>(searched.size());
  std::vector<std::int32_t> order;
  order.reserve(3 * searched.size());
  for (const Int3 t : searched)
    for (int axis = 0; axis < 3; ++axis) order.push_back(static_cast<std::int32_t>(t[axis]));
  tiles = DeviceBuffer<std::int32_t>(order.size(), stream);
  check(cudaMemcpyAsync(tiles.data(), order.data(), tiles.bytes(), cudaMemcpyHostToDevice,
                        stream.get()));
  ranges = DeviceBuffer<std::byte>(2 * lattice.sample_bytes() * tile_count, stream);
}

void DeviceVolume::Impl::load(std::span<const Int3> more, const BrickLookup& bricks) {
  if (more.size() > loaded_blocks() - loaded_)
    throw UsageError("more tiles are loaded than the volume has room for");
  while (!more.empty()) {
    const std::size_t room = staging_[turn_].blocks.size() / block_bytes();
    const std::size_t count = std::min(room, more.size());
    load_staged(more.first(count), bricks);
    more = more.subspan(count);
  }
  complete_if_loaded();
}

std::byte* DeviceVolume::Impl::take_blocks(std::span<const Int3> more,
                                           const std::function<bool(std::size_t)>& has_samples) {
  if (more.size() > loaded_blocks() - loaded_)
    throw UsageError("more tiles are loaded than the volume has room for");
  const std::size_t first = loaded_ + 1;
  for (std::size_t i = 0; i < more.size(); ++i)
    if (has_samples(i))
      table_[static_cast<std::size_t>(linear_index(more[i], lattice.tiles()))] =
          static_cast<std::uint32_t>(first + i);
  loaded_ += more.size();
  return tile_blocks.data() + first * block_bytes();
}

void DeviceVolume::Impl::complete_if_loaded() {
  if (loaded_ == loaded_blocks()) complete();
}

void DeviceVolume::Impl::load_staged(std::span<const Int3> more, const BrickLookup& bricks) {
  const NvtxRange range("upload tile blocks");
  Staging& staging = staging_[turn_];
  turn_ ^= 1;
  staging.copied.wait();
  std::vector<char> has_samples(more.size());
  tbb::parallel_for(std::size_t{0}, more.size(), [&](std::size_t i) {
    has_samples[i] = gather_tile_block(lattice, bricks, fill_value, more[i],
                                       staging.blocks.data() + i * block_bytes());
  });
  std::byte* const to = take_blocks(more, [&](std::size_t i) { return has_samples[i] != 0; });
  check(cudaMemcpyAsync(to, staging.blocks.data(), more.size() * block_bytes(),
                        cudaMemcpyHostToDevice, stream.get()));
  staging.copied.record(stream);
}

/// All samples are there, or on their way.
void DeviceVolume::Impl::complete() {
  const NvtxRange range("find tile ranges");
  bool is_needed = false;
  for (std::size_t i = 0; i < table_.size(); ++i) is_needed |= table_[i] != i + 1;
  if (is_needed) {
    block_of_tile = DeviceBuffer<std::uint32_t>(table_.size(), stream);
    check(cudaMemcpyAsync(block_of_tile.data(), table_.data(), block_of_tile.bytes(),
                          cudaMemcpyHostToDevice, stream.get()));
  }
  launch_first_columns(lattice.type, tile_blocks.data(),
                       static_cast<std::uint32_t>(loaded_blocks() + 1), columns.data(),
                       stream.get());
  if (tile_count > 0)
    launch_tile_ranges(lattice.type, params(), tiles.data(), tile_count, ranges.data(),
                       stream.get());
  stream.wait();
  table_ = {};
  staging_.clear();
}

TileParams DeviceVolume::Impl::params() const {
  TileParams p{};
  if (array) {
    array->give(p);
  } else {
    p.tile_blocks = tile_blocks.data();
    p.block_of_tile = block_of_tile.data();
    p.fill_tile_block = 0;
    p.columns = columns.data();
  }
  for (int axis = 0; axis < 3; ++axis) {
    p.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
    p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
  }
  return p;
}

DeviceVolume::DeviceVolume(const Lattice& lattice, const BrickLookup& bricks, double fill_value) {
  const std::vector<Int3> searched = all_tiles(lattice, true), loaded = all_tiles(lattice, false);
  impl_ = std::make_unique<Impl>(lattice, fill_value, DeviceTiles{searched, loaded}, kStagingBytes,
                                 Stream());
  impl_->load(loaded, bricks);
}

DeviceVolume::DeviceVolume(const Lattice& lattice, double fill_value, const DeviceTiles& tiles,
                           const DeviceTarget* target)
    : impl_(std::make_unique<Impl>(
          lattice, fill_value, tiles, 0,
          target ? Stream(target->stream, target->memory ? target->memory : pool_memory())
                 : Stream())) {}
DeviceVolume::DeviceVolume(const DeviceArray& array) : impl_(std::make_unique<Impl>(array)) {}
DeviceVolume::~DeviceVolume() = default;

const Lattice& DeviceVolume::lattice() const { return impl_->lattice; }

bool DeviceVolume::has_nan() const { return impl_->has_nan; }

std::uint64_t DeviceVolume::bytes() const {
  return impl_->tile_blocks.bytes() + impl_->columns.bytes() + impl_->block_of_tile.bytes() +
         impl_->tiles.bytes() + impl_->ranges.bytes();
}

}  // namespace isobrick::gpu
