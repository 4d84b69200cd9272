#pragma once

#include <memory>

#include "core/thread_annotations.h"
#include "viewer/scene/activity_count.h"
#include "viewer/scene/current_device.h"
#include "viewer/scene/level_skipping.h"
#include "viewer/scene/mesh_statistics.h"
#include "viewer/scene/request_queue.h"
#include "viewer/scene/resident_meshes.h"
#include "viewer/scene/scene_stream.h"
#include "viewer/scene/slice_slots.h"

namespace isobrick::inline v0 {

/// The state that a stream shares with its threads. All parts but `meshes` have locks of their own.
/// It outlives the stream while a thread is blocked in a read, or a device makes a mesh; then the
/// queue is closed, and `meshes` and `device` are empty.
///
/// Lock order: `meshes_mutex` or the slice slots' lock before the queue's. Code that holds another
/// lock calls nothing.
struct StreamState {
  StreamState(std::shared_ptr<const BrickSource> source, std::shared_ptr<const NodeTree> tree,
              StreamOptions options);

  const std::shared_ptr<const BrickSource> source;
  const std::shared_ptr<const NodeTree> tree;
  const StreamOptions options;
  const int threads;  ///< number of worker threads
  ResidentBricks bricks;
  const NodeMesher planner;  ///< reports what a mesh needs; makes none

  RequestQueue queue;
  SliceSlots slices{queue};
  CurrentDevice device;
  MeshStatistics statistics;
  LevelSkipping skipping{threads};
  ActivityCount workers;        ///< worker threads
  ActivityCount notifications;  ///< running calls of options.on_change

  mutable Mutex meshes_mutex;
  ResidentMeshes meshes ISOBRICK_GUARDED_BY(meshes_mutex);

  /// Queues the meshes that the cut lacks and cancels all others. `overdue`: a plan that skips
  /// levels was too slow, so the new one skips none.
  void plan(bool overdue) ISOBRICK_REQUIRES(meshes_mutex);
  /// Pauses the queue's meshes while the budget is full.
  void pause_if_full() ISOBRICK_REQUIRES(meshes_mutex) { queue.pause_meshes(meshes.full()); }
  /// Stores a mesh. `by`: the device that made it; null: a worker thread.
  void add_mesh(NodeMesh mesh, const DeviceMesher* by) ISOBRICK_EXCLUDES(meshes_mutex);
  /// Calls options.on_change, without holding a lock.
  void notify_change() ISOBRICK_EXCLUDES(meshes_mutex);
};

}  // namespace isobrick
