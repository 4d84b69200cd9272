#include "gpu/resident/array_blocks.h"

#include <algorithm>

#include "gpu/memory/nvtx_range.h"
#include "gpu/resident/array_kernel.h"

namespace isobrick::inline v0::gpu {
namespace {

std::uint32_t tiles_of(const Lattice& lattice) {
  return static_cast<std::uint32_t>(volume(lattice.tiles()));
}

}  // namespace

ArrayBlocks::ArrayBlocks(const DeviceArray& array, const Lattice& lattice, const Stream& stream)
    : lattice_(lattice),
      stream_(stream),
      block_of_tile_(tiles_of(lattice), stream),
      counts_(1, stream) {
  array_.samples = array.samples;
  for (int axis = 0; axis < 3; ++axis) {
    array_.strides[axis] = array.strides[axis] / static_cast<Index>(lattice.sample_bytes());
    array_.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
    array_.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
  }
  take_room(0);  // the first launch says how much is needed
}

void ArrayBlocks::launch_ranges() {
  const NvtxRange range("find the ranges of an array");
  part_ranges_ = {16 * lattice_.sample_bytes() * tiles_of(lattice_), stream_};
  found_nan_ = {1, stream_};
  check(cudaMemsetAsync(found_nan_.data(), 0, found_nan_.bytes(), stream_.get()));
  finding_.array = array_;
  finding_.count = tiles_of(lattice_);
  finding_.part_ranges = part_ranges_.data();
  finding_.found_nan = found_nan_.data();
  launch_part_ranges(lattice_.type, finding_, stream_.get());
}

bool ArrayBlocks::finish_ranges(const std::int32_t* order, void* ranges) {
  finding_.order = order;
  finding_.ranges = ranges;
  launch_join_ranges(lattice_.type, finding_, stream_.get());
  std::uint32_t found = 0;
  check(cudaMemcpyAsync(&found, found_nan_.data(), sizeof found, cudaMemcpyDeviceToHost,
                        stream_.get()));
  stream_.wait();
  part_ranges_ = {};
  found_nan_ = {};
  return found != 0;
}

void ArrayBlocks::launch_load(const TileItem* items, const std::uint32_t* found,
                              std::uint32_t* item_count, int reach) {
  const NvtxRange range("copy tiles of an array");
  ArrayBlockCounts* const counts = counts_.data();
  check(cudaMemcpyAsync(&counts->copied, &counts->wanted, sizeof counts->copied,
                        cudaMemcpyDeviceToDevice, stream_.get()));
  ArrayLoadParams p{};
  p.array = array_;
  p.items = items;
  p.found = found;
  p.item_count = item_count;
  p.reach = reach;
  p.block_of_tile = block_of_tile_.data();
  p.places = places_.data();
  p.counts = counts;
  p.room = room_;
  p.tile_blocks = tile_blocks_.data();
  p.columns = columns_.data();
  gpu::launch_load(lattice_.type, p, stream_.get());
  ++loads_;
}

std::uint64_t ArrayBlocks::bytes_to_make_room(std::uint32_t wanted) const {
  return loads_ == 1 ? bytes_of(wanted) - bytes_of(std::min(room_, wanted)) : 0;
}

void ArrayBlocks::make_room(std::uint32_t wanted) {
  if (loads_ == 1)
    take_room(wanted);
  else
    forget();
}

void ArrayBlocks::give(TileParams& p) const {
  p.tile_blocks = tile_blocks_.data();
  p.columns = columns_.data();
  p.block_of_tile = block_of_tile_.data();
  p.fill_tile_block = 0;
}

std::uint64_t ArrayBlocks::bytes_of(std::uint32_t room) const {
  return (room + std::uint64_t{1}) * (kTileBlockSamples + kColumnSamples) *
             lattice_.sample_bytes() +
         room * sizeof(std::uint32_t);
}

std::uint64_t ArrayBlocks::bytes() const {
  return bytes_of(room_) + block_of_tile_.bytes() + counts_.bytes();
}

/// Block 0 stands for tiles that nobody looks at; it is read, and what is read is not used.
void ArrayBlocks::take_room(std::uint32_t room) {
  tile_blocks_ = {};
  columns_ = {};
  places_ = {};
  room_ = 0;
  const std::size_t samples = room + std::size_t{1}, bytes = lattice_.sample_bytes();
  tile_blocks_ = {samples * kTileBlockSamples * bytes, stream_};
  columns_ = {samples * kColumnSamples * bytes, stream_};
  places_ = {room, stream_};
  check(cudaMemsetAsync(tile_blocks_.data(), 0, kTileBlockSamples * bytes, stream_.get()));
  check(cudaMemsetAsync(columns_.data(), 0, kColumnSamples * bytes, stream_.get()));
  room_ = room;
  forget();
}

void ArrayBlocks::forget() {
  static_assert(kNone == 0xffffffffu);
  check(cudaMemsetAsync(block_of_tile_.data(), 0xff, block_of_tile_.bytes(), stream_.get()));
  check(cudaMemsetAsync(counts_.data(), 0, counts_.bytes(), stream_.get()));
  loads_ = 0;
}

}  // namespace isobrick::gpu
