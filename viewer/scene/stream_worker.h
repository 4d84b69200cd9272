#pragma once

#include <memory>
#include <optional>

#include "viewer/scene/stream_state.h"

namespace isobrick {

/// Makes the meshes and slices that a stream's queue holds. One for each thread.
class StreamWorker {
 public:
  explicit StreamWorker(std::shared_ptr<StreamState> state);

  /// Until the queue is closed.
  void run();

 private:
  using RequestPtr = RequestQueue::RequestPtr;

  void make_mesh(const RequestPtr& request);
  void make_slice(const RequestPtr& request);
  void prefetch_bricks();
  void find_thin_structure();
  std::optional<NodeMesh> mesh_of(const RequestPtr& request);
  bool send(const GridView& grid, const RequestPtr& request);
  void plan_if_overdue();

  const std::shared_ptr<StreamState> state_;
  NodeMesher mesher_;
};

}  // namespace isobrick
