#include "viewer/scene/stream_state.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace isobrick::inline v0 {
namespace {

int thread_count(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
}

}  // namespace

StreamState::StreamState(std::shared_ptr<const BrickSource> s, std::shared_ptr<const NodeTree> t,
                         StreamOptions o)
    : source(std::move(s)),
      tree(std::move(t)),
      options(std::move(o)),
      threads(thread_count(options.threads)),
      bricks(source, options.brick_bytes),
      planner(tree->grid(), bricks, options.origin, options.inside),
      meshes(tree, options.mesh_bytes, options.device_bytes) {}

void StreamState::plan(bool overdue) {
  bricks.forget_needs();
  MeshPlan next = meshes.plan(planner, overdue ? 0 : skipping.max_meshes());
  skipping.set_plan(next.skips_levels && !next.jobs.empty());
  pause_if_full();
  queue.replace_meshes(std::move(next.jobs));
}

void StreamState::add_mesh(NodeMesh mesh, const DeviceMesher* by) {
  statistics.add(mesh, tree->active_blocks(mesh.key, mesh.isovalue), by != nullptr);
  // A mesh that did not fit on the device needs an upload. Old meshes make room on the device, once
  // for all meshes in this state.
  const bool had_no_room =
      by != nullptr && !mesh.device && !mesh.empty() && !by->shared_blocks().empty();
  auto shared = std::make_shared<const NodeMesh>(std::move(mesh));
  const MutexLock lock(meshes_mutex);
  if (had_no_room) meshes.make_device_room();
  meshes.put(std::move(shared));
  pause_if_full();
}

void StreamState::notify_change() {
  if (!options.on_change || !notifications.begin()) return;
  options.on_change();
  notifications.end();
}

}  // namespace isobrick
