#include "pipeline/index/level_scan.h"

#include <tbb/parallel_for.h>

#include <memory>

#include "pipeline/slab_piece.h"

namespace isobrick::inline v0 {

void scan_level(const StoreReader& store, int level, std::size_t piece_bytes, LevelRanges& ranges,
                const BrickFailure& failure, const RangeEmit& blocks, const RangeEmit& bricks,
                const std::function<void(std::uint64_t)>& advance, const BrickChecksum& checksum,
                ValueCounts* counts) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 piece =
      largest_piece(lattice.extent, lattice.brick, piece_bytes / lattice.sample_bytes());
  const Int3 pieces = ceil_div(lattice.extent, piece);
  const auto bytes_of = [&](Int3 e) {
    return static_cast<std::size_t>(volume(e)) * lattice.sample_bytes();
  };
  // Zeroed once, so that what a damaged brick leaves is never uninitialised.
  const auto buffer = std::make_unique<std::byte[]>(bytes_of(min(piece, lattice.extent)));
  for_each_point({{0, 0, 0}, pieces}, [&](Int3 p) {
    const Box3 box = intersect({p * piece, (p + Int3{1, 1, 1}) * piece}, lattice.box());
    read_slab(store, level, box, buffer.get(), failure, checksum);
    ranges.add(box, buffer.get());
    if (counts != nullptr)
      tbb::parallel_for(box.lo.z, box.hi.z, [&](Index z) {
        counts->add(buffer.get(), box, {{box.lo.x, box.lo.y, z}, {box.hi.x, box.hi.y, z + 1}});
      });
    if (p.x + 1 == pieces.x && p.y + 1 == pieces.y) ranges.close(box.hi.z, blocks, bricks);
    advance(bytes_of(box.extent()));
  });
}

}  // namespace isobrick
