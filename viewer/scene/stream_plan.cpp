#include "viewer/scene/stream_plan.h"

#include <algorithm>
#include <tuple>
#include <unordered_map>

namespace isobrick::inline v0 {
namespace {

bool more_urgent(const MeshJob& a, const MeshJob& b) {
  const auto key = [](const MeshJob& j) {
    return std::tuple(!j.visible, !j.resident, -j.key.level, -j.pixels, j.distance, j.key.node.z,
                      j.key.node.y, j.key.node.x);
  };
  return key(a) < key(b);
}

class JobPlanner {
 public:
  JobPlanner(const NodeTree& tree, const Cut& cut, MeshCache& meshes, MeshPlan& plan)
      : tree_(tree), cut_(cut), meshes_(meshes), plan_(plan) {}

  void run(double max_meshes) {
    for (const double isovalue : cut_.isovalues)
      for (const CutNode& node : cut_.nodes) add(node, isovalue);
    plan_.skips_levels =
        2 * missing_.size() > with_surface_ && static_cast<double>(plan_.jobs.size()) <= max_meshes;
    for (const MissingNode& missing : missing_) {
      if (missing.isovalue != ancestors_isovalue_) ancestors_.clear();
      ancestors_isovalue_ = missing.isovalue;
      add_ancestors(*missing.node, missing.isovalue);
    }
  }

 private:
  struct MissingNode {
    const CutNode* node;
    double isovalue;
  };

  void add(const CutNode& node, double isovalue) {
    if (node.clipped || !tree_.may_hold_surface(node.key, isovalue, node.coarser)) return;
    ++with_surface_;
    if (meshes_.find(node.key, isovalue, node.coarser)) return;
    if (!meshes_.has_any(node.key, isovalue)) missing_.push_back({&node, isovalue});
    plan_.jobs.push_back(
        {node.key, isovalue, node.coarser, node.visible, false, node.pixels, node.distance});
  }

  void add_ancestors(const CutNode& node, double isovalue) {
    std::vector<MeshJob>& jobs = plan_.jobs;
    const int top = tree_.grid().coarsest_stored();
    for (NodeKey n = node.key; n.level < top;) {
      n = tree_.grid().parent(n);
      const auto [place, added] = ancestors_.try_emplace(n);
      Ancestor& ancestor = place->second;
      if (!added) {
        if (ancestor.visible || !node.visible) return;  // its ancestors are up to date, too
        ancestor.visible = true;
        if (ancestor.job != kNoJob) jobs[ancestor.job].visible = true;
        if (ancestor.stands_in) return;
        continue;
      }
      ancestor.visible = node.visible;
      if (meshes_.has_any(n, isovalue)) {
        meshes_.find_any(n, isovalue, 0);  // marks the mesh as used
        ancestor.stands_in = true;
        return;
      }
      if (plan_.skips_levels && n.level < top) continue;
      if (!tree_.active(n, isovalue)) continue;
      ancestor.job = jobs.size();
      jobs.push_back({n, isovalue, 0, node.visible, false, node.pixels, node.distance});
    }
  }

  static constexpr std::size_t kNoJob = ~std::size_t{0};
  struct Ancestor {
    std::size_t job = kNoJob;  ///< index in the plan's jobs
    bool visible = false;      ///< a node below is visible
    bool stands_in = false;    ///< has a mesh that is substituted: no ancestor of it is needed
  };

  const NodeTree& tree_;
  const Cut& cut_;
  MeshCache& meshes_;
  MeshPlan& plan_;
  std::size_t with_surface_ = 0;  ///< nodes of the cut with a surface, summed over isovalues
  std::vector<MissingNode> missing_;
  std::unordered_map<NodeKey, Ancestor, NodeKeyHash> ancestors_;
  double ancestors_isovalue_ = 0;  ///< isovalue of `ancestors_`
};

}  // namespace

MeshPlan plan_jobs(const NodeTree& tree, const Cut& cut, MeshCache& meshes,
                   const NodeMesher& mesher, double max_meshes) {
  MeshPlan plan;
  JobPlanner(tree, cut, meshes, plan).run(max_meshes);
  for (MeshJob& job : plan.jobs)
    job.resident = mesher.is_half_resident(job.key, job.isovalue, job.coarser);
  std::sort(plan.jobs.begin(), plan.jobs.end(), more_urgent);
  return plan;
}

}  // namespace isobrick
