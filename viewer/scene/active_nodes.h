#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "viewer/scene/node_flags.h"
#include "viewer/scene/node_tree.h"

namespace isobrick::inline v0 {

/// The active nodes of a few isovalues: one bit for each node of the finest level, one byte for
/// each node of the other levels. Reading is thread-safe.
class ActiveNodes {
 public:
  /// Without any active node. `tree` must outlive it.
  explicit ActiveNodes(const NodeTree& tree);

  /// Replaces all. `finest`: one bit for each node of level 0, x fastest, set where one of the
  /// isovalues stabs the node's range.
  void set(std::span<const double> isovalues, std::vector<std::uint64_t> finest);

  const std::vector<double>& isovalues() const { return isovalues_; }
  /// Number of active nodes of level 0.
  std::uint64_t count() const { return count_; }

  /// Whether the node itself, or a node of level 0 below it, is active.
  bool below(const NodeKey& n) const;

 private:
  template <class F>
  void for_each_bit(Index first, Index count, F&& f) const;

  const NodeTree& tree_;
  std::vector<double> isovalues_;
  std::vector<std::uint64_t> finest_;
  NodeFlags above_;  ///< set where a node of level 0 below is active
  std::uint64_t count_ = 0;
};

}  // namespace isobrick
