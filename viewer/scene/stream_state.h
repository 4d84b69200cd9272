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

namespace isobrick {

/// What a stream and its threads share. Parts lock themselves, but for the meshes. It outlives the
/// stream for as long as a thread is held up in a read, or a device in making what it was sent;
/// then the queue is closed, and neither meshes nor a device are here any more.
///
/// Lock order: `meshes_mutex` or the slice slots' before the queue's. Under the others nothing is
/// called.
struct StreamState {
  StreamState(std::shared_ptr<const BrickSource> source, std::shared_ptr<const NodeTree> tree,
              StreamOptions options);

  const std::shared_ptr<const BrickSource> source;
  const std::shared_ptr<const NodeTree> tree;
  const StreamOptions options;
  const int threads;  ///< that make meshes
  ResidentBricks bricks;
  const NodeMesher planner;  ///< tells what a mesh needs, and makes none

  RequestQueue queue;
  SliceSlots slices{queue};
  CurrentDevice device;
  MeshStatistics statistics;
  LevelSkipping skipping{threads};
  ActivityCount workers;        ///< threads
  ActivityCount notifications;  ///< calls of options.on_change

  mutable Mutex meshes_mutex;
  ResidentMeshes meshes ISOBRICK_GUARDED_BY(meshes_mutex);

  /// Queues the meshes that the cut lacks and cancels all others. `late`: meshes of a plan that
  /// skips levels have not come soon enough.
  void plan(bool overdue) ISOBRICK_REQUIRES(meshes_mutex);
  /// Meshes are made while there is room for them.
  void pause_if_full() ISOBRICK_REQUIRES(meshes_mutex) { queue.pause_meshes(meshes.full()); }
  /// Takes over a mesh; `by`: the device that made it, or null.
  void add_mesh(NodeMesh mesh, const DeviceMesher* by) ISOBRICK_EXCLUDES(meshes_mutex);
  /// drawable() or slice() may give something new. Without any lock.
  void notify_change() ISOBRICK_EXCLUDES(meshes_mutex);
};

}  // namespace isobrick
