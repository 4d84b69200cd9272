#pragma once

#include <memory>
#include <optional>

#include "viewer/scene/stream_state.h"

namespace isobrick::inline v0 {

/// Makes the meshes and slices of a stream's queue. One for each worker thread.
class StreamWorker {
 public:
  explicit StreamWorker(std::shared_ptr<StreamState> state);

  /// Returns once the queue is closed.
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
