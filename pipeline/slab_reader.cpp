#include "pipeline/slab_reader.h"

#include <tbb/parallel_for.h>

#include <optional>
#include <vector>

#include <isobrick/error.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/zarr/codec.h"
#include "core/copy_box.h"

namespace isobrick::inline v0 {
namespace {

/// Whether the brick is there.
bool read_brick(const StoreReader& store, int level, Int3 brick, std::byte* out,
                const BrickChecksum& checksum) {
  if (!checksum) return store.read_brick(level, brick, out);
  // A brick that is there may have the checksum of an absent one.
  const std::optional<std::uint32_t> found = store.read_brick_unchecked(level, brick, out);
  checksum(brick, found.value_or(kAbsentBrick));
  return found.has_value();
}

/// Decodes a brick and copies what it shares with `box`, whose samples are `out`.
void copy_brick(const StoreReader& store, int level, Int3 brick, Box3 box, std::byte* out,
                const BrickChecksum& checksum) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  thread_local std::vector<std::byte> samples;
  samples.resize(lattice.brick_bytes());
  const Box3 shared = intersect(lattice.brick_box(brick), box);
  if (read_brick(store, level, brick, samples.data(), checksum))
    copy_box({samples.data(), lattice.full_brick_box(brick)}, {out, box}, shared,
             lattice.sample_bytes());
  else
    fill_box(lattice.type, store.info().fill_value, {out, box}, shared);
}

}  // namespace

std::uint64_t slab_memory(const StoreInfo& store, int level, int threads) {
  const LevelInfo& info = store.levels[static_cast<std::size_t>(level)];
  // Each thread has a brick, what it was encoded to, and what else there is in its chunk.
  return info.index_bytes + decode_extra(store, threads) +
         static_cast<std::uint64_t>(threads) * 2 * info.lattice.brick_bytes();
}

void read_slab(const StoreReader& store, int level, Box3 box, std::byte* out,
               const BrickFailure& failure, const BrickChecksum& checksum) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Box3 bricks = lattice.bricks_of(box);
  const Int3 count = bricks.extent();
  tbb::parallel_for(Index{0}, volume(count), [&](Index i) {
    const Int3 brick = bricks.lo + point_at(i, count);
    if (!failure) return copy_brick(store, level, brick, box, out, checksum);
    try {
      copy_brick(store, level, brick, box, out, checksum);
    } catch (const Error& e) {
      failure(brick, e.what());
    }
  });
}

}  // namespace isobrick
