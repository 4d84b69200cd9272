#include "viewer/scene/node_tree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace isobrick::inline v0 {
namespace {

/// Nodes along each axis whose ranges are read together: at level 0 one stored chunk of block
/// ranges.
constexpr Index kGroup = StoreReader::kRangeChunk * kBlockEdge / kNodeEdge;

/// Rounds `r` outwards to float. An empty range stays empty.
ValueRange<float> outwards(const ValueRange<double>& r) {
  ValueRange<float> out;
  if (r.empty()) return out;
  constexpr double max_float = std::numeric_limits<float>::max();
  constexpr float inf = std::numeric_limits<float>::infinity();
  const auto convert = [](double v) {
    return std::abs(v) > max_float ? std::copysign(inf, static_cast<float>(v > 0 ? 1 : -1))
                                   : static_cast<float>(v);
  };
  out.lo = convert(r.lo);
  out.hi = convert(r.hi);
  if (static_cast<double>(out.lo) > r.lo) out.lo = std::nextafter(out.lo, -inf);
  if (static_cast<double>(out.hi) < r.hi) out.hi = std::nextafter(out.hi, inf);
  if (r.lo < -max_float) out.lo = -inf;
  if (r.hi > max_float) out.hi = inf;
  return out;
}

Box3 blocks_of(Box3 samples, Int3 all) {
  // Block b has the samples 16 b to 16 b + 16, so the blocks of the cells suffice.
  const Int3 edge{kBlockEdge, kBlockEdge, kBlockEdge};
  const Int3 lo{samples.lo.x / edge.x, samples.lo.y / edge.y, samples.lo.z / edge.z};
  const Int3 cells = samples.hi - Int3{1, 1, 1};
  return intersect({lo, max(ceil_div(cells, edge), lo + Int3{1, 1, 1})}, {{0, 0, 0}, all});
}

}  // namespace

NodeTree::NodeTree(const BrickSource& source)
    : grid_(source.info()), thin_structure_(std::make_unique<ThinStructure>(grid_, source.info())) {
  // Runs all levels at once, since a level may be a single group.
  std::vector<std::pair<int, Box3>> groups;
  for (int v = 0; v < grid_.levels(); ++v) {
    const Int3 all = grid_.level(v).nodes;
    nodes_.emplace_back(static_cast<std::size_t>(volume(all)));
    parts_.emplace_back(v > 0 ? static_cast<std::size_t>(volume(grid_.level(parts_level(v)).nodes))
                              : 0);
    for_each_point({{0, 0, 0}, ceil_div(all, {kGroup, kGroup, kGroup})}, [&](Int3 g) {
      groups.emplace_back(v,
                          intersect({g * kGroup, (g + Int3{1, 1, 1}) * kGroup}, {{0, 0, 0}, all}));
    });
  }
  tbb::parallel_for(std::size_t{0}, groups.size(),
                    [&](std::size_t i) { read_nodes(source, groups[i].first, groups[i].second); });
  for (int v = 1; v < grid_.levels(); ++v) merge_below(v);
}

void NodeTree::read_nodes(const BrickSource& source, int v, Box3 nodes) {
  const int stored = grid_.level(v).source;
  const Int3 blocks = source.info().levels[static_cast<std::size_t>(stored)].lattice.blocks();
  const Box3 samples{grid_.samples({v, nodes.lo}).lo,
                     grid_.samples({v, nodes.hi - Int3{1, 1, 1}}).hi};
  const RangeTable table = source.block_ranges(stored, blocks_of(samples, blocks));
  for_each_point(nodes, [&](Int3 p) {
    const auto i = static_cast<std::size_t>(linear_index(p, grid_.level(v).nodes));
    nodes_[static_cast<std::size_t>(v)][i] =
        summary(table, blocks_of(grid_.samples({v, p}), blocks), blocks_in({v, p}));
    if (v > 0) read_parts(table, {v, p}, blocks);
  });
  constexpr Index per_node = kNodeEdge / kBlockEdge;
  if (v == 0)
    thin_structure_->include(table,
                             intersect({nodes.lo * per_node, nodes.hi * per_node}, table.box));
}

double NodeTree::part(const Node& node, double value) {
  const double lo = node.own.lo, width = static_cast<double>(node.own.hi) - lo;
  if (!(width > 0) || std::isinf(width)) return 0;
  return std::clamp((value - lo) / width * kParts, 0.0, static_cast<double>(kParts - 1));
}

/// Number of 16³ blocks of the node's cells. Where grid points are several samples apart, there are
/// fewer than blocks of samples.
std::uint8_t NodeTree::blocks_in(const NodeKey& n) const {
  return static_cast<std::uint8_t>(
      volume(ceil_div(grid_.node_cells(n), {kBlockEdge, kBlockEdge, kBlockEdge})));
}

NodeTree::Node NodeTree::summary(const RangeTable& table, Box3 blocks,
                                 std::uint8_t max_blocks) const {
  Node node;
  ValueRange<double> own;
  for_each_point(blocks, [&](Int3 b) { own.include(table.at(b)); });
  node.own = node.below = outwards(own);
  for_each_point(blocks, [&](Int3 b) {
    const ValueRange<double>& range = table.at(b);
    if (range.empty() || range.lo == range.hi) return;
    const auto first = static_cast<std::size_t>(part(node, range.lo));
    const auto last = static_cast<std::size_t>(part(node, range.hi));
    for (std::size_t i = first; i <= last; ++i)
      if (node.blocks[i] < max_blocks) ++node.blocks[i];
  });
  return node;
}

/// The nodes of parts_level() within a node, as a box.
Box3 NodeTree::parts_of(const NodeKey& n) const {
  Box3 parts = grid_.children(n);
  if (n.level < 2) return parts;
  const Int3 ratio = grid_.ratio(n.level - 2);
  return intersect({parts.lo * ratio, parts.hi * ratio},
                   {{0, 0, 0}, grid_.level(n.level - 2).nodes});
}

void NodeTree::read_parts(const RangeTable& table, const NodeKey& n, Int3 all_blocks) {
  const int level = parts_level(n.level);
  for_each_point(parts_of(n), [&](Int3 p) {
    ValueRange<double> range;
    for_each_point(blocks_of(grid_.samples_within({level, p}, n.level), all_blocks),
                   [&](Int3 b) { range.include(table.at(b)); });
    parts_[static_cast<std::size_t>(n.level)]
          [static_cast<std::size_t>(linear_index(p, grid_.level(level).nodes))] = outwards(range);
  });
}

void NodeTree::merge_below(int v) {
  const Int3 all = grid_.level(v).nodes;
  std::size_t i = 0;
  for_each_point({{0, 0, 0}, all}, [&](Int3 p) {
    Node& node = nodes_[static_cast<std::size_t>(v)][i++];
    for_each_point(grid_.children({v, p}), [&](Int3 c) {
      node.below.include(at({v - 1, c}).below);
    });
  });
}

bool NodeTree::active(const NodeKey& n, double isovalue) const {
  return at(n).own.stabbed_by(isovalue);
}

bool NodeTree::active_below(const NodeKey& n, double isovalue) const {
  return at(n).below.stabbed_by(isovalue);
}

bool NodeTree::loses(const NodeKey& n, double isovalue) const {
  if (n.level == 0 || !active_below(n, isovalue)) return false;
  const int level = parts_level(n.level);
  const auto& parts = parts_[static_cast<std::size_t>(n.level)];
  bool lost = false;
  for_each_point(parts_of(n), [&](Int3 p) {
    const auto i = static_cast<std::size_t>(linear_index(p, grid_.level(level).nodes));
    lost |= !parts[i].stabbed_by(isovalue) && active_below({level, p}, isovalue);
  });
  return lost;
}

bool NodeTree::may_hold_surface(const NodeKey& n, double isovalue, std::uint32_t coarser) const {
  if (active(n, isovalue)) return true;
  for (int i = 0; i < kDirections; ++i)
    if (coarser >> i & 1 && active(grid_.parent({n.level, n.node + direction(i)}), isovalue))
      return true;
  return false;
}

int NodeTree::active_blocks(const NodeKey& n, double isovalue) const {
  const Node& node = at(n);
  if (!node.own.stabbed_by(isovalue)) return 0;
  return std::max<int>(1, node.blocks[static_cast<std::size_t>(part(node, isovalue))]);
}

std::uint64_t NodeTree::bytes() const {
  std::uint64_t bytes = 0;
  for (const auto& level : nodes_) bytes += level.capacity() * sizeof(Node);
  for (const auto& level : parts_) bytes += level.capacity() * sizeof(ValueRange<float>);
  return bytes + thin_structure_->bytes();
}

}  // namespace isobrick
