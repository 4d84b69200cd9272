#include "viewer/scene/drawable.h"

namespace isobrick::inline v0 {
namespace {

class CoverBuilder {
 public:
  CoverBuilder(const NodeTree& tree, const CutIndex& cut, double isovalue, int number,
               MeshCache& meshes, std::vector<NodeDraw>& nodes, bool& complete)
      : tree_(tree),
        cut_(cut),
        isovalue_(isovalue),
        number_(number),
        meshes_(meshes),
        finest_(meshes.finest_level(isovalue)),
        nodes_(nodes),
        complete_(complete) {}

  bool cover(const NodeKey& n) {
    if (const CutNode* in_cut = cut_.find(n))
      return in_cut->clipped || cover_cut(n, in_cut->coarser);
    if (!tree_.active_below(n, isovalue_)) return cover_border(n);
    const std::size_t mark = nodes_.size();
    bool all = true;
    for_each_child(n, [&](const NodeKey& child) { all &= cover(child); });
    // Without a surface on this level, a missing mesh of it hides nothing.
    if (all || !tree_.active(n, isovalue_)) return true;
    const MeshPtr mesh = meshes_.find_any(n, isovalue_, 0);
    if (!mesh) return false;
    nodes_.resize(mark);
    draw(mesh);
    return true;
  }

 private:
  bool cover_cut(const NodeKey& n, std::uint32_t coarser) {
    if (!tree_.may_hold_surface(n, isovalue_, coarser)) return true;
    const MeshPtr mesh = meshes_.find_any(n, isovalue_, coarser);
    if (mesh) {
      complete_ &= mesh->coarser == coarser;
      draw(mesh);
      return true;
    }
    complete_ = false;
    if (cover_finer(n)) return true;
    // Triangles that only come from a neighbour's values can wait.
    return !tree_.active(n, isovalue_);
  }

  /// The node has no surface below, but may have triangles on borders to coarser neighbours.
  bool cover_border(const NodeKey& n) {
    for_each_child(n, [&](const NodeKey& child) { cover(child); });
    return true;
  }

  /// Substitutes the node's finer nodes, if all meshes of them exist.
  bool cover_finer(const NodeKey& n) {
    if (n.level <= finest_) return false;
    const std::size_t mark = nodes_.size();
    bool all = true, any = false;
    for_each_child(n, [&](const NodeKey& child) {
      if (!all || !tree_.active(child, isovalue_)) return;
      any = true;
      if (const MeshPtr mesh = meshes_.find_any(child, isovalue_, 0))
        draw(mesh);
      else
        all = cover_finer(child);
    });
    if (all && any) return true;
    nodes_.resize(mark);
    return false;
  }

  void draw(const MeshPtr& mesh) {
    if (!mesh->empty() || !mesh->damage.empty()) nodes_.push_back({mesh, number_});
  }

  template <class F>
  void for_each_child(const NodeKey& n, F&& f) {
    for_each_point(tree_.grid().children(n), [&](Int3 c) { f(NodeKey{n.level - 1, c}); });
  }

  const NodeTree& tree_;
  const CutIndex& cut_;
  double isovalue_;
  int number_;
  MeshCache& meshes_;
  int finest_;  ///< finest level with a mesh of the isovalue
  std::vector<NodeDraw>& nodes_;
  bool& complete_;
};

}  // namespace

CutIndex::CutIndex(const Cut& cut) : nodes_(cut.nodes), numbers_(nodes_.size()) {
  for (std::uint32_t i = 0; i < nodes_.size(); ++i) {
    const auto [number, added] = numbers_.insert(nodes_[i].key);
    if (added) number = i;
  }
}

const CutNode* CutIndex::find(const NodeKey& key) const {
  const std::uint32_t* number = numbers_.find(key);
  return number ? &nodes_[*number] : nullptr;
}

bool append_drawable(const NodeTree& tree, const CutIndex& cut, double isovalue, int number,
                     MeshCache& meshes, std::vector<NodeDraw>& nodes, bool& complete) {
  CoverBuilder cover(tree, cut, isovalue, number, meshes, nodes, complete);
  const int top = tree.grid().levels() - 1;
  bool all = true;
  for_each_point({{0, 0, 0}, tree.grid().level(top).nodes}, [&](Int3 p) {
    all &= cover.cover({top, p});
  });
  return all;
}

}  // namespace isobrick
