#include "io/meshes/levels/tile_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "core/vectors.h"
#include "io/bytes/output_file.h"
#include "io/meshes/levels/level_fragments.h"
#include "io/meshes/levels/tile_content.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::uint64_t kChildren = 8;
/// Tiles that one file describes; a larger tree has a file for every few levels.
constexpr std::size_t kFileTiles = 4096;
constexpr std::size_t kFileLevels = 4;
/// By how many steps of its lattice a level moves what it stores, and level 0 as well.
constexpr double kRoundedSteps = 4;

std::string file_name(std::size_t level, std::uint64_t key) {
  const GridCell cell = cell_of_key(key);
  return fmt::format("tileset_{}_{}_{}_{}.json", level, cell[0], cell[1], cell[2]);
}

}  // namespace

TileBox::TileBox(const MeshBounds& bounds, double thickness) {
  for (int axis = 0; axis < 3; ++axis) {
    const double lo = bounds.lo[axis], hi = bounds.hi[axis];
    const double centre = lo + (hi - lo) / 2;
    double half = std::max({hi - centre, centre - lo, thickness / 2});
    while (centre - half > lo || centre + half < hi)
      half = std::nextafter(half, std::numeric_limits<double>::infinity());
    centre_[axis] = centre;
    half_[axis] = half;
  }
}

double TileBox::diagonal() const { return 2 * length(half_); }

ordered_json TileBox::json() const {
  return {centre_.x, centre_.y, centre_.z, half_.x, 0, 0, 0, half_.y, 0, 0, 0, half_.z};
}

MeshBounds united(const MeshBounds& a, const MeshBounds& b) {
  MeshBounds both = a;
  for (int axis = 0; axis < 3; ++axis) {
    both.lo[axis] = std::min(a.lo[axis], b.lo[axis]);
    both.hi[axis] = std::max(a.hi[axis], b.hi[axis]);
  }
  return both;
}

std::string tileset_text(double error, ordered_json root) {
  const ordered_json tileset{
      {"asset", {{"version", "1.1"}}}, {"geometricError", error}, {"root", std::move(root)}};
  return tileset.dump() + "\n";
}

ordered_json tile_json(const TileBox& box, double error) {
  return {{"boundingVolume", {{"box", box.json()}}}, {"geometricError", error}};
}

TileTree::TileTree(const ChunkGrid& grid, const std::vector<EncodedLevel>& levels, double metres)
    : metres_(metres),
      thickness_(metres * double{grid.edge} / static_cast<double>(ChunkGrid::kSteps)),
      origin_(Vec3d{grid.origin[0], grid.origin[1], grid.origin[2]} * metres) {
  for (const EncodedLevel& level : levels) {
    const double steps = thickness_ * (std::ldexp(1, static_cast<int>(errors_.size())) + 1);
    errors_.push_back(errors_.empty() ? 0 : metres * level.error + kRoundedSteps * steps);
    add_level(level.fragments, grid);
  }
  while (!nodes_.empty() && nodes_.back().size() > 1) add_level({}, grid);
  if (nodes_.empty() || nodes_.back().empty()) {
    root_ = TileBox({}, thickness_);
    return;
  }
  root_ = nodes_.back().front().box;
  error_ = std::max(root_.diagonal(), errors_.back());
}

TileBox TileTree::content_box(const FragmentPlace& place, const EncodedFragment& fragment) const {
  MeshBounds bounds;
  for (std::size_t i = 0; i < 3; ++i) {
    const int axis = static_cast<int>(i);
    bounds.lo[axis] = metres_ * double{tile_coordinate(place, i, fragment.lo[i])};
    bounds.hi[axis] = metres_ * double{tile_coordinate(place, i, fragment.hi[i])};
  }
  return TileBox(bounds, thickness_);
}

void TileTree::add_level(const std::vector<EncodedFragment>& fragments, const ChunkGrid& grid) {
  const int level = static_cast<int>(nodes_.size());
  std::vector<Node> added;
  auto fragment = fragments.begin();
  const auto add_fragments_before = [&](std::uint64_t key) {
    for (; fragment != fragments.end() && fragment->key < key; ++fragment)
      added.push_back(
          {fragment->key, content_box({grid, level, cell_of_key(fragment->key)}, *fragment), true});
  };
  if (level > 0)
    for (const Node& child : nodes_.back()) {
      const std::uint64_t key = child.key / kChildren;
      add_fragments_before(key + 1);
      if (added.empty() || added.back().key != key) added.push_back({key, child.box});
      Node& parent = added.back();
      parent.box = TileBox(united(parent.box.bounds(), child.box.bounds()), thickness_);
    }
  add_fragments_before(std::numeric_limits<std::uint64_t>::max());
  count_ += added.size();
  nodes_.push_back(std::move(added));
}

double TileTree::error_of(std::size_t level, const Node& node) const {
  const std::size_t coarsest = errors_.size() - 1;
  if (level <= coarsest && node.has_content) return errors_[level];
  // A coarse surface missed this cell and passes it by. So it is refined as early as its parent,
  // beside which the fine surface would have a hole.
  if (level < coarsest) return errors_[level + 1];
  return std::max(errors_.back(), node.box.diagonal());
}

/// A file that is being written.
struct TileTree::Writing {
  const fs::path& folder;
  std::uint64_t bytes = 0;  ///< of the files so far
};

bool TileTree::begins_file(std::size_t level) const {
  const std::size_t depth = nodes_.size() - 1 - level;
  return count_ > kFileTiles && depth % kFileLevels == 0 && level > 1;
}

ordered_json TileTree::tile_of(Writing& writing, std::size_t level, const Node& node,
                               bool is_root) const {
  ordered_json tile = tile_json(node.box, error_of(level, node));
  if (is_root)
    tile["refine"] = "REPLACE";
  else if (begins_file(level)) {
    const std::string name = file_name(level, node.key);
    const std::string text =
        tileset_text(error_of(level, node), tile_of(writing, level, node, true));
    write_new_file((writing.folder / name).string(), text);
    writing.bytes += text.size();
    tile["content"] = {{"uri", name}};
    return tile;
  }
  if (node.has_content)
    tile["content"] = {{"uri", content_name(static_cast<int>(level), cell_of_key(node.key))}};
  if (level == 0) return tile;
  const std::vector<Node>& finer = nodes_[level - 1];
  ordered_json children = ordered_json::array();
  for (auto child = std::ranges::lower_bound(finer, node.key * kChildren, {}, &Node::key);
       child != finer.end() && child->key / kChildren == node.key; ++child)
    children.push_back(tile_of(writing, level - 1, *child, false));
  // The fine surface passes this cell by: nothing takes the place of the coarse one.
  if (children.empty()) children.push_back(tile_json(node.box, 0));
  tile["children"] = std::move(children);
  return tile;
}

std::string TileTree::content_name(int level, const GridCell& cell) {
  return fmt::format("{}/{}_{}_{}.glb", level, cell[0], cell[1], cell[2]);
}

std::uint64_t TileTree::write(const fs::path& folder) const {
  Writing writing{folder};
  ordered_json root;
  if (nodes_.empty() || nodes_.back().empty()) {
    root = tile_json(root_, 0);
    root["refine"] = "REPLACE";
  } else {
    root = tile_of(writing, nodes_.size() - 1, nodes_.back().front(), true);
  }
  root["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, origin_.x, origin_.y, origin_.z, 1};
  const std::string text = tileset_text(error_, std::move(root));
  write_new_file((folder / "tileset.json").string(), text);
  return writing.bytes + text.size();
}

}  // namespace isobrick
