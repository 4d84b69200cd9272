#include "isobrick/pipeline/convert_level.h"

#include <tbb/parallel_invoke.h>
#include <tbb/parallel_pipeline.h>

#include <cstring>

#include "isobrick/bricks/codec.h"
#include "isobrick/core/pod_buffer.h"

namespace isobrick {
namespace {

/// Copies the samples that brick and box share into the brick's dense array.
void gather(Box3 brick, Int3 brick_extent, Box3 box, const std::byte* samples,
            std::size_t sample_bytes, std::byte* out) {
  const auto row = static_cast<std::size_t>(brick.hi.x - brick.lo.x) * sample_bytes;
  for (Index z = brick.lo.z; z < brick.hi.z; ++z)
    for (Index y = brick.lo.y; y < brick.hi.y; ++y) {
      const Int3 p{brick.lo.x, y, z};
      std::memcpy(
          out + static_cast<std::size_t>(linear_index(p - brick.lo, brick_extent)) * sample_bytes,
          samples + static_cast<std::size_t>(linear_index(p - box.lo, box.extent())) * sample_bytes,
          row);
    }
}

}  // namespace

LevelWriter::LevelWriter(StoreWriter& store, const StoreLayout& layout, int level,
                         int bricks_in_flight, ConvertJournal* journal, Progress& progress)
    : store_(store),
      layout_(layout),
      info_(layout.levels[static_cast<std::size_t>(level)]),
      level_(level),
      bricks_in_flight_(static_cast<std::size_t>(bricks_in_flight)),
      shards_(ceil_div(info_.lattice.extent, info_.shard)),
      bricks_per_shard_(ceil_div(info_.shard, info_.lattice.brick)),
      journal_(journal),
      progress_(progress),
      ranges_(make_level_ranges(info_.lattice)) {
  for_each_point({{0, 0, 0}, shards_},
                 [&](Int3 s) { kept_.push_back(store_.shard_is_whole(level_, s)); });
}

LevelWriter::Parcel LevelWriter::pack(Int3 brick, Box3 box, const std::byte* samples) const {
  const Lattice& lattice = info_.lattice;
  Parcel parcel;
  parcel.brick = brick;
  const Int3 n = bricks_per_shard_;
  parcel.kept = is_kept({brick.x / n.x, brick.y / n.y, brick.z / n.z});
  if (parcel.kept && journal_ == nullptr) return parcel;
  thread_local PodBuffer<std::byte> scratch;
  scratch.resize(lattice.brick_bytes());
  gather(lattice.brick_box(brick), lattice.brick, box, samples, lattice.sample_bytes(),
         scratch.data());
  pad_brick(lattice, brick, layout_.fill_value, scratch.data());
  if (journal_ != nullptr) parcel.crc = crc32c(scratch.span());
  if (!parcel.kept)
    parcel.encoded =
        encode_brick(lattice.type, scratch.span(), layout_.fill_value, layout_.zstd_level);
  return parcel;
}

void LevelWriter::deliver(const Parcel& parcel) {
  ++counts_.bricks;
  if (journal_ != nullptr) journal_->add(parcel.brick, parcel.crc);
  if (parcel.kept)
    ++counts_.kept;
  else if (parcel.encoded)
    store_.put(level_, parcel.brick, *parcel.encoded);
  else
    ++counts_.absent;
  const auto samples =
      static_cast<std::uint64_t>(volume(info_.lattice.brick_box(parcel.brick).extent()));
  progress_.advance(level_ == 0 ? samples * info_.lattice.sample_bytes() : 0);
}

void LevelWriter::write(Box3 box, const std::byte* samples,
                        const std::function<void()>& meanwhile) {
  tbb::parallel_invoke([&] { write_bricks(box, samples); }, [&] { ranges_->add(box, samples); },
                       meanwhile);
}

void LevelWriter::write_bricks(Box3 box, const std::byte* samples) {
  const Int3 edge = info_.lattice.brick;
  const Int3 first{box.lo.x / edge.x, box.lo.y / edge.y, box.lo.z / edge.z};
  const Int3 count = ceil_div(box.hi, edge) - first;
  Index next = 0;
  const auto take = [&](tbb::flow_control& flow) {
    if (next == volume(count)) flow.stop();
    const Index i = next++;
    return first + Int3{i % count.x, i / count.x % count.y, i / (count.x * count.y)};
  };
  tbb::parallel_pipeline(
      bricks_in_flight_,
      tbb::make_filter<void, Int3>(tbb::filter_mode::serial_in_order, take) &
          tbb::make_filter<Int3, Parcel>(tbb::filter_mode::parallel,
                                         [&](Int3 brick) { return pack(brick, box, samples); }) &
          tbb::make_filter<Parcel, void>(tbb::filter_mode::serial_in_order,
                                         [&](const Parcel& parcel) { deliver(parcel); }));
}

void LevelWriter::finish_shards(Index z1) {
  const bool all = z1 >= info_.lattice.extent.z;
  for (; next_shard_z_ < shards_.z && (all || (next_shard_z_ + 1) * info_.shard.z <= z1);
       ++next_shard_z_)
    for_each_point({{0, 0, next_shard_z_}, {shards_.x, shards_.y, next_shard_z_ + 1}}, [&](Int3 s) {
      if (!is_kept(s)) store_.finish_shard(level_, s);
    });
}

void LevelWriter::record(Index z1) {
  if (journal_ != nullptr) journal_->close(z1);
}

void LevelWriter::close(Index z1) {
  ranges_->close(
      z1,
      [&](Box3 items, std::span<const std::byte> pairs) {
        store_.put_block_ranges(level_, items, pairs);
      },
      [&](Box3 items, std::span<const std::byte> pairs) {
        store_.put_brick_ranges(level_, items, pairs);
      });
  finish_shards(z1);
}

}  // namespace isobrick
