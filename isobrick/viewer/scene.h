#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "isobrick/viewer/node_search.h"
#include "isobrick/viewer/scene_stream.h"

namespace isobrick {

/// A store on the screen, without the screen: choose a view, draw what there is.
/// Functions are called from one thread.
class Scene {
 public:
  /// Reads the ranges of all levels. options.origin is set to the volume's middle
  /// (see origin()); an index of active nodes takes up to a quarter of
  /// options.brick_bytes. Throws what NodeTree does.
  Scene(std::shared_ptr<const BrickSource> source, StreamOptions options);

  /// World space; positions of meshes are relative to it.
  Vec3d origin() const { return origin_; }
  const NodeTree& tree() const { return *tree_; }

  /// Chooses the cut for a view and starts on it. `budget.triangles_per_block` is
  /// replaced by what has been measured, as far as that has moved by a fifth. Cheap enough for
  /// every frame; nothing happens when view, isovalues and budget are those of before, and the
  /// stream goes on where the cut is the same.
  void update(const std::vector<double>& isovalues, const View& view, CutBudget budget);

  /// What finds the nodes that isovalues cross.
  NodeSearch& search() { return *search_; }
  const NodeSearch& search() const { return *search_; }

  /// Seconds that the steps of the last update() took.
  struct Times {
    double search = 0;  ///< finding the nodes that isovalues cross
    double cut = 0;     ///< choosing nodes
    double plan = 0;    ///< handing them to the stream
  };
  const Times& times() const { return times_; }

  const Cut& cut() const { return cut_; }
  std::shared_ptr<const Drawable> drawable() { return stream_->drawable(); }
  SceneStream& stream() { return *stream_; }
  const SceneStream& stream() const { return *stream_; }

 private:
  std::shared_ptr<const NodeTree> tree_;
  Vec3d origin_;
  std::unique_ptr<NodeSearch> search_;
  CutSelector selector_;
  Cut cut_;
  std::optional<View> view_;  ///< of the last cut
  CutBudget budget_;
  std::unique_ptr<SceneStream> stream_;
  double per_block_ = 0;  ///< triangles, as cuts are estimated with
  Times times_;
};

/// World space of a volume's middle.
Vec3d middle_of(const NodeGrid& grid);

}  // namespace isobrick
