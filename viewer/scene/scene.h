#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "viewer/scene/node_search.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick::inline v0 {

/// Seconds for each step of the last LOD cut.
struct CutTimes {
  double search = 0;  ///< finding active nodes
  double cut = 0;
  double plan = 0;  ///< planning the stream's meshes
};

/// The scene of a store, without OpenGL: chooses nodes for a view and returns the meshes to draw.
/// All functions are for one thread.
class Scene {
 public:
  /// Reads the ranges of all levels. Replaces options.origin by the volume's middle (see origin()).
  /// The index over active nodes may take a quarter of options.brick_bytes. Throws what NodeTree
  /// throws.
  Scene(std::shared_ptr<const BrickSource> source, StreamOptions options);

  /// World space; mesh positions are relative to it.
  Vec3d origin() const { return origin_; }
  const NodeTree& tree() const { return *tree_; }

  /// Chooses the LOD cut for a view and passes it to the stream. Replaces
  /// `budget.triangles_per_block` by the measured value, once that has changed by a fifth. Does
  /// nothing if view, isovalues and budget equal the last ones; does not call the stream if the cut
  /// does. The time grows with the nodes of the cut, which the budget bounds. After an exception
  /// the next call tries again.
  void update(const std::vector<double>& isovalues, const View& view, const CutBudget& budget);
  /// Of the last update().
  const std::vector<double>& isovalues() const { return isovalues_; }

  /// Finds active nodes. Only update() may call its find().
  NodeSearch& search() { return *search_; }
  const NodeSearch& search() const { return *search_; }

  /// Of the last chosen cut.
  const CutTimes& times() const { return times_; }
  const Cut& cut() const { return cut_; }

  /// See SceneStream.
  std::shared_ptr<const Drawable> drawable() { return stream_->drawable(); }
  bool is_newest(const Drawable& drawable) const { return stream_->is_newest(drawable); }
  bool idle() const { return stream_->idle(); }

  SceneStream& stream() { return *stream_; }
  const SceneStream& stream() const { return *stream_; }

 private:
  /// The arguments of a cut, besides the previous cut.
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
  std::optional<CutRequest> chosen_;  ///< of cut_; nullopt after a failure
  Cut cut_;
  CutTimes times_;
  double triangles_per_block_ = 0;  ///< for estimates; 0: the budget's
};

/// The middle of a volume in world space.
Vec3d middle_of(const NodeGrid& grid);

}  // namespace isobrick
