#include "isobrick/viewer/stream_plan.h"

#include <algorithm>
#include <tuple>
#include <unordered_map>

namespace isobrick {
namespace {

bool more_urgent(const MeshJob& a, const MeshJob& b) {
  const auto key = [](const MeshJob& j) {
    return std::tuple(!j.visible, !j.resident, -j.key.level, -j.pixels, j.distance, j.key.node.z,
                      j.key.node.y, j.key.node.x);
  };
  return key(a) < key(b);
}

class Planner {
 public:
  Planner(const NodeTree& tree, MeshCache& meshes, std::vector<MeshJob>& jobs)
      : tree_(tree), meshes_(meshes), jobs_(jobs) {}

  void add(const CutNode& node, double isovalue) {
    if (node.cut_away || !tree_.may_hold_surface(node.key, isovalue, node.coarser) ||
        meshes_.find(node.key, isovalue, node.coarser))
      return;
    const bool bare = !meshes_.has_any(node.key, isovalue);
    jobs_.push_back(
        {node.key, isovalue, node.coarser, node.visible, false, node.pixels, node.distance});
    if (bare) add_ancestors(node, isovalue);
  }
  void next_isovalue() { ancestors_.clear(); }

 private:
  void add_ancestors(const CutNode& node, double isovalue) {
    for (NodeKey n = node.key; tree_.grid().has_parent(n);) {
      n = tree_.grid().parent(n);
      const auto [place, added] = ancestors_.try_emplace(n, jobs_.size());
      if (!added) {
        if (place->second < jobs_.size() && jobs_[place->second].key == n)
          jobs_[place->second].visible |= node.visible;
        continue;
      }
      if (meshes_.has_any(n, isovalue)) {
        meshes_.find_any(n, isovalue, 0);  // is kept
        place->second = ~std::size_t{0};
        return;
      }
      if (tree_.active(n, isovalue))
        jobs_.push_back({n, isovalue, 0, node.visible, false, node.pixels, node.distance});
      else
        place->second = ~std::size_t{0};
    }
  }

  const NodeTree& tree_;
  MeshCache& meshes_;
  std::vector<MeshJob>& jobs_;
  std::unordered_map<NodeKey, std::size_t, NodeKeyHash> ancestors_;
};

}  // namespace

std::vector<MeshJob> plan_jobs(const NodeTree& tree, const Cut& cut, MeshCache& meshes,
                               const ResidentBricks& bricks, const NodeMesher& mesher) {
  std::vector<MeshJob> jobs;
  Planner planner(tree, meshes, jobs);
  for (const double isovalue : cut.isovalues) {
    for (const CutNode& node : cut.nodes) planner.add(node, isovalue);
    planner.next_isovalue();
  }
  for (MeshJob& job : jobs) {
    const NodeMesher::Needs needs = mesher.needs(job.key);
    job.resident = bricks.resident(needs.stored, needs.bricks);
  }
  std::sort(jobs.begin(), jobs.end(), more_urgent);
  return jobs;
}

}  // namespace isobrick
