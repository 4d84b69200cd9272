#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "viewer/scene/node_search.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick {

/// Seconds that the steps of the last LOD cut took.
struct CutTimes {
  double search = 0;  ///< finding the nodes that isovalues cross
  double cut = 0;     ///< choosing nodes
  double plan = 0;    ///< handing them to the stream
};

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

  /// Chooses the LOD cut for a view and hands it to the stream. `budget.triangles_per_block` is
  /// replaced by the measured value, once that has moved by a fifth. Does nothing when view,
  /// isovalues and budget equal those before, and does not disturb the stream when the cut does.
  /// Takes about 0.3 µs for each node of the cut, whose number the budget bounds. After an
  /// exception the next call tries again.
  void update(const std::vector<double>& isovalues, const View& view, const CutBudget& budget);
  /// Of the last update().
  const std::vector<double>& isovalues() const { return isovalues_; }

  /// Finds the nodes that isovalues cross; find() is for update() alone.
  NodeSearch& search() { return *search_; }
  const NodeSearch& search() const { return *search_; }

  /// Of the cut that was chosen last.
  const CutTimes& times() const { return times_; }
  const Cut& cut() const { return cut_; }

  /// See SceneStream.
  std::shared_ptr<const Drawable> drawable() { return stream_->drawable(); }
  bool is_newest(const Drawable& drawable) const { return stream_->is_newest(drawable); }
  bool idle() const { return stream_->idle(); }

  SceneStream& stream() { return *stream_; }
  const SceneStream& stream() const { return *stream_; }

 private:
  /// What a cut is a function of, beside the cut before.
  struct CutRequest {
    std::vector<double> isovalues;
    View view;
    CutBudget budget;
    bool thin_known;  ///< ThinStructure::known()
    friend bool operator==(const CutRequest&, const CutRequest&) = default;
  };

  Cut select(const ActiveNodes& active, const View& view, const CutBudget& budget);

  std::shared_ptr<const NodeTree> tree_;
  Vec3d origin_;
  std::unique_ptr<NodeSearch> search_;
  std::unique_ptr<SceneStream> stream_;
  std::optional<CutSelector> selector_;
  std::vector<double> isovalues_;
  std::optional<CutRequest> chosen_;  ///< that cut_ was chosen for; nothing after a failure
  Cut cut_;
  CutTimes times_;
  double triangles_per_block_ = 0;  ///< that cuts are estimated with; 0: the budget's
};

/// World space of a volume's middle.
Vec3d middle_of(const NodeGrid& grid);

}  // namespace isobrick
