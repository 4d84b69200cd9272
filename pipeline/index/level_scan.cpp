#include "pipeline/index/level_scan.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "pipeline/slab_piece.h"

namespace isobrick::inline v0 {

void scan_box(const StoreReader& store, int level, Box3 all, std::size_t piece_bytes,
              std::vector<std::byte>& buffer, LevelRanges& ranges, const ScanOutputs& outputs) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 piece =
      largest_piece(all.extent(), lattice.brick, piece_bytes / lattice.sample_bytes());
  const auto bytes_of = [&](Int3 e) {
    return static_cast<std::size_t>(volume(e)) * lattice.sample_bytes();
  };
  const std::size_t most = bytes_of(min(piece, all.extent()));
  if (buffer.size() < most) {
    buffer = {};  // never the old and the new at once
    buffer.resize(most);
  }
  for_each_point({{0, 0, 0}, ceil_div(all.extent(), piece)}, [&](Int3 p) {
    const Box3 box = intersect({all.lo + p * piece, all.lo + (p + Int3{1, 1, 1}) * piece}, all);
    read_slab(store, level, box, buffer.data(), outputs.failure, outputs.checksum);
    ranges.add(box, buffer.data());
    if (outputs.counts != nullptr)
      tbb::parallel_for(box.lo.z, box.hi.z, [&](Index z) {
        outputs.counts->add(buffer.data(), box,
                            {{box.lo.x, box.lo.y, z}, {box.hi.x, box.hi.y, z + 1}});
      });
    outputs.advance(bytes_of(box.extent()));
  });
}

void scan_level(const StoreReader& store, int level, std::size_t piece_bytes, LevelRanges& ranges,
                const RangeEmit& blocks, const RangeEmit& bricks, const ScanOutputs& outputs) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  std::vector<std::byte> buffer;
  Box3 layer = lattice.box();
  for (; layer.lo.z < lattice.extent.z; layer.lo.z = layer.hi.z) {
    layer.hi.z = std::min(layer.lo.z + lattice.brick.z, lattice.extent.z);
    scan_box(store, level, layer, piece_bytes, buffer, ranges, outputs);
    ranges.close(layer.hi.z, blocks, bricks);
  }
}

}  // namespace isobrick
