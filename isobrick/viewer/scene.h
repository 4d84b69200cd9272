#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "isobrick/viewer/cut_worker.h"

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
  /// stream goes on where the cut is the same. The choice takes some half a millisecond, but where
  /// the processor slows down many times that: after `patience` seconds it goes on by itself, but
  /// for the first one, and false is returned; what is below is then that of the cut before. Throws
  /// what went wrong, also with the choice of an earlier call; the next one tries again.
  bool update(const std::vector<double>& isovalues, const View& view, const CutBudget& budget,
              double patience = std::numeric_limits<double>::infinity());
  /// What the last update() returned.
  bool up_to_date() const { return up_to_date_; }
  /// Of the last update().
  const std::vector<double>& isovalues() const { return asked_.isovalues; }

  /// What finds the nodes that isovalues cross; find() is for update() alone.
  NodeSearch& search() { return *search_; }
  const NodeSearch& search() const { return *search_; }

  /// Of the cut that was chosen last.
  CutTimes times() const { return worker_->times(); }
  const Cut& cut() const { return *cut_; }

  /// See SceneStream.
  std::shared_ptr<const Drawable> drawable();
  bool is_newest(const Drawable& drawable) const;
  bool idle() const { return up_to_date_ && stream_->idle(); }
  /// Those of before while a cut is being chosen.
  const StreamCounters& counters();

  SceneStream& stream() { return *stream_; }
  const SceneStream& stream() const { return *stream_; }

 private:
  std::shared_ptr<const NodeTree> tree_;
  Vec3d origin_;
  std::unique_ptr<NodeSearch> search_;
  std::unique_ptr<SceneStream> stream_;
  std::unique_ptr<CutWorker> worker_;
  CutRequest asked_;
  bool up_to_date_ = false;
  bool again_ = true;  ///< what was asked for last has failed, or nothing was
  std::shared_ptr<const Cut> cut_ = std::make_shared<const Cut>();
  std::shared_ptr<const Drawable> drawn_;
  StreamCounters counters_;
  double per_block_ = 0;  ///< triangles, as cuts are estimated with
};

/// World space of a volume's middle.
Vec3d middle_of(const NodeGrid& grid);

}  // namespace isobrick
