#include "pipeline/convert/convert_level.h"

#include <tbb/parallel_invoke.h>

#include "pipeline/in_order.h"

namespace isobrick::inline v0 {
LevelWriter::LevelWriter(StoreWriter& store, const StoreLayout& layout, int level,
                         int bricks_in_flight, ConvertJournal* journal, ValueCounts* counts,
                         Progress& progress)
    : store_(store),
      info_(layout.levels[static_cast<std::size_t>(level)]),
      level_(level),
      bricks_in_flight_(static_cast<std::size_t>(bricks_in_flight)),
      shards_(ceil_div(info_.lattice.extent, info_.shard)),
      bricks_per_shard_(ceil_div(info_.shard, info_.lattice.brick)),
      journal_(journal),
      output_(store, layout, level, journal, counts, progress),
      ranges_(make_level_ranges(info_.lattice)) {
  for_each_point({{0, 0, 0}, shards_},
                 [&](Int3 s) { kept_.push_back(store_.shard_is_whole(level_, s)); });
}

void LevelWriter::write(Box3 box, const std::byte* samples,
                        const std::function<void()>& meanwhile) {
  tbb::parallel_invoke([&] { write_bricks(box, samples); }, [&] { ranges_->add(box, samples); },
                       meanwhile);
}

void LevelWriter::write_bricks(Box3 box, const std::byte* samples) {
  const Box3 bricks = info_.lattice.bricks_of(box);
  const Int3 count = bricks.extent();
  Index next = 0;
  const auto take = [&](PackedBrick& packed) {
    if (next == volume(count)) return false;
    packed.brick = bricks.lo + point_at(next++, count);
    return true;
  };
  const auto pack = [&](PackedBrick& packed) {
    const bool kept = is_kept(floor_div(packed.brick, bricks_per_shard_));
    packed = output_.pack(packed.brick, box, samples, kept);
  };
  run_in_order<PackedBrick>(bricks_in_flight_, take, pack,
                            [&](const PackedBrick& packed) { output_.deliver(packed); });
}

void LevelWriter::finish_shards(Index z1) {
  const bool all = z1 >= info_.lattice.extent.z;
  for (; next_shard_z_ < shards_.z && (all || (next_shard_z_ + 1) * info_.shard.z <= z1);
       ++next_shard_z_)
    for_each_point({{0, 0, next_shard_z_}, {shards_.x, shards_.y, next_shard_z_ + 1}}, [&](Int3 s) {
      if (is_kept(s))
        store_.keep_shard(level_, s);
      else
        store_.finish_shard(level_, s);
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
