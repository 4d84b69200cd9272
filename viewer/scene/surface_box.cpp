#include "viewer/scene/surface_box.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "core/box_union.h"

namespace isobrick::inline v0 {
namespace {

/// Blocks along an edge of a node; nodes along an edge of a range chunk.
constexpr Index kNodeBlocks = kNodeEdge / kBlockEdge;
constexpr Index kChunkNodes = StoreReader::kRangeChunk / kNodeBlocks;
static_assert(kChunkNodes * kNodeBlocks == StoreReader::kRangeChunk);

/// The intersection; nullopt if they only touch. `part` may be flat.
std::optional<IndexBox> within(const IndexBox& part, const IndexBox& box) {
  IndexBox inside;
  for (int axis = 0; axis < 3; ++axis) {
    inside.lo[axis] = std::max(part.lo[axis], box.lo[axis]);
    inside.hi[axis] = std::min(part.hi[axis], box.hi[axis]);
    const bool flat = part.lo[axis] == part.hi[axis] && inside.lo[axis] == inside.hi[axis];
    if (!flat && !(inside.lo[axis] < inside.hi[axis])) return std::nullopt;
  }
  return inside;
}

/// Maximum blocks of a box that is computed from samples.
constexpr Index kFewBlocks = 1024;

/// For each sample of a box: how many isovalues it reaches.
class ReachCounts {
 public:
  static constexpr std::size_t kMaxIsovalues = 254;

  /// Reads the bricks, one at a time. Throws what reading throws.
  ReachCounts(const BrickSource& source, std::span<const double> isovalues, Box3 samples)
      : samples_(samples), reached_(static_cast<std::size_t>(volume(samples.extent())), kNaN) {
    const StoreInfo& info = source.info();
    const Lattice& lattice = info.levels.front().lattice;
    std::vector<std::byte> brick(lattice.brick_bytes());
    for_each_point(lattice.bricks_of(samples), [&](Int3 b) {
      const bool stored = source.read_brick(0, b, brick.data());
      for_each_point(intersect(lattice.brick_box(b), samples), [&](Int3 p) {
        const Int3 q = p - b * lattice.brick;
        at(p) = count(isovalues, stored ? value(brick, lattice, q) : double{info.fill_value});
      });
    });
  }

  /// The bounding box of the lattice edges that an isovalue crosses.
  std::optional<IndexBox> crossed() const {
    BoxUnion<IndexBox> box;
    for_each_point(samples_, [&](Int3 p) {
      for (int axis = 0; axis < 3; ++axis) {
        Int3 next = p;
        if (++next[axis] >= samples_.hi[axis]) continue;
        const std::uint8_t a = at(p), b = at(next);
        if (a != b && a != kNaN && b != kNaN) box.include({to_vec(p), to_vec(next)});
      }
    });
    return box.box();
  }

 private:
  static constexpr std::uint8_t kNaN = 255;

  static Vec3d to_vec(Int3 p) {
    return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
  }
  static double value(const std::vector<std::byte>& brick, const Lattice& lattice, Int3 q) {
    const auto i = static_cast<std::size_t>(linear_index(q, lattice.brick));
    return visit_scalar(lattice.type, [&](auto tag) {
      typename decltype(tag)::type v;
      std::memcpy(&v, brick.data() + i * sizeof v, sizeof v);
      return static_cast<double>(v);
    });
  }
  static std::uint8_t count(std::span<const double> isovalues, double value) {
    if (std::isnan(value)) return kNaN;
    return static_cast<std::uint8_t>(
        std::count_if(isovalues.begin(), isovalues.end(), [&](double v) { return v <= value; }));
  }
  std::size_t index(Int3 p) const {
    return static_cast<std::size_t>(linear_index(p - samples_.lo, samples_.extent()));
  }
  std::uint8_t& at(Int3 p) { return reached_[index(p)]; }
  std::uint8_t at(Int3 p) const { return reached_[index(p)]; }

  Box3 samples_;
  std::vector<std::uint8_t> reached_;
};

class Search {
 public:
  Search(const BrickSource& source, const NodeTree& tree, std::span<const double> isovalues,
         const IndexBox& part)
      : source_(source), tree_(tree), isovalues_(isovalues), part_(part) {}

  std::optional<IndexBox> run() {
    std::vector<IndexBox> chunks = active_chunks();
    // Chunks at the ends of the volume come first: they make the box so large that it contains most
    // others.
    BoxUnion<IndexBox> all;
    for (const IndexBox& chunk : chunks) all.include(chunk);
    if (!all.box()) return std::nullopt;
    const Vec3d middle = (all.box()->lo + all.box()->hi) * 0.5;
    const auto outwards = [&](const IndexBox& box) {
      double distance = 0;
      for (int axis = 0; axis < 3; ++axis)
        distance = std::max({distance, middle[axis] - box.lo[axis], box.hi[axis] - middle[axis]});
      return distance;
    };
    std::stable_sort(chunks.begin(), chunks.end(), [&](const IndexBox& a, const IndexBox& b) {
      return outwards(a) > outwards(b);
    });
    for (const IndexBox& chunk : chunks)
      if (!found_.covers(chunk)) read_blocks(chunk);
    if (!found_.box()) return std::nullopt;
    return cells_of(*found_.box());
  }

 private:
  bool crossed(const ValueRange<double>& range) const {
    return std::any_of(isovalues_.begin(), isovalues_.end(),
                       [&](double isovalue) { return range.stabbed_by(isovalue); });
  }

  /// For each range chunk with active nodes within `part_`: their bounding box.
  std::vector<IndexBox> active_chunks() const {
    const Int3 nodes = tree_.grid().level(0).nodes, edge{kChunkNodes, kChunkNodes, kChunkNodes};
    std::vector<IndexBox> chunks;
    for_each_point({{0, 0, 0}, ceil_div(nodes, edge)}, [&](Int3 chunk) {
      BoxUnion<IndexBox> active;
      for_each_point(intersect({chunk * edge, (chunk + Int3{1, 1, 1}) * edge}, {{0, 0, 0}, nodes}),
                     [&](Int3 node) {
                       const ValueRange<float> range = tree_.range({0, node});
                       if (!crossed({range.lo, range.hi})) return;
                       if (const auto box = within(part_, tree_.grid().box({0, node})))
                         active.include(*box);
                     });
      if (active.box()) chunks.push_back(*active.box());
    });
    return chunks;
  }

  /// Includes the active blocks that meet `box`, which lies within a range chunk.
  void read_blocks(const IndexBox& box) {
    const Int3 all = source_.info().levels.front().lattice.blocks();
    Box3 blocks;
    for (int axis = 0; axis < 3; ++axis) {
      blocks.lo[axis] = static_cast<Index>(std::floor(box.lo[axis] / kBlockEdge));
      blocks.hi[axis] = static_cast<Index>(std::ceil(box.hi[axis] / kBlockEdge));
      // `part` may be a plane between two blocks.
      blocks.hi[axis] = std::min(std::max(blocks.hi[axis], blocks.lo[axis] + 1), all[axis]);
      blocks.lo[axis] = std::min(blocks.lo[axis], blocks.hi[axis] - 1);
    }
    const RangeTable table = source_.block_ranges(0, blocks);
    std::size_t i = 0;
    for_each_point(blocks, [&](Int3 block) {
      if (!crossed(table.ranges[i++])) return;
      if (const auto active = within(part_, box_of(block))) found_.include(*active);
    });
  }

  /// The box of the cells within the box of blocks, if those are few.
  IndexBox cells_of(const IndexBox& blocks) const {
    Box3 samples;
    for (int axis = 0; axis < 3; ++axis) {
      samples.lo[axis] = static_cast<Index>(std::floor(blocks.lo[axis]));
      samples.hi[axis] = static_cast<Index>(std::ceil(blocks.hi[axis])) + 1;
    }
    const Int3 cells = samples.extent() - Int3{1, 1, 1}, edge{kBlockEdge, kBlockEdge, kBlockEdge};
    if (volume(ceil_div(cells, edge)) > kFewBlocks ||
        isovalues_.size() > ReachCounts::kMaxIsovalues)
      return blocks;
    try {
      const auto crossed = ReachCounts(source_, isovalues_, samples).crossed();
      return (crossed ? within(blocks, *crossed) : crossed).value_or(blocks);
    } catch (const DamageError&) {  // reported where the brick is drawn
      return blocks;
    }
  }

  IndexBox box_of(Int3 block) const {
    IndexBox box;
    for (int axis = 0; axis < 3; ++axis) {
      const Index end = std::min((block[axis] + 1) * kBlockEdge, tree_.grid().cells()[axis]);
      box.lo[axis] = static_cast<double>(block[axis] * kBlockEdge);
      box.hi[axis] = static_cast<double>(end);
    }
    return box;
  }

  const BrickSource& source_;
  const NodeTree& tree_;
  std::span<const double> isovalues_;
  const IndexBox& part_;
  BoxUnion<IndexBox> found_;
};

}  // namespace

std::optional<IndexBox> surface_box(const BrickSource& source, const NodeTree& tree,
                                    std::span<const double> isovalues, const IndexBox& part) {
  return Search(source, tree, isovalues, part).run();
}

}  // namespace isobrick
