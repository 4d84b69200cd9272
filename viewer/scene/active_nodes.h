#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "viewer/scene/node_flags.h"
#include "viewer/scene/node_tree.h"

namespace isobrick {

/// The nodes in which something of a few isosurfaces may lie. A bit for each node of
/// the finest level, a byte for each of the others. Reading is thread-safe.
class ActiveNodes {
 public:
  /// None.
  explicit ActiveNodes(const NodeTree& tree);

  /// `finest`: a bit for each node of level 0, x fastest, set where one of the
  /// isovalues stabs the node's range.
  void set(std::span<const double> isovalues, std::vector<std::uint64_t> finest);

  const std::vector<double>& isovalues() const { return isovalues_; }
  /// Active nodes of level 0.
  std::uint64_t count() const { return count_; }

  /// Whether the node's own field crosses one of the isovalues, or that of a node of
  /// level 0 below it.
  bool below(const NodeKey& n) const;

 private:
  template <class F>
  void for_each_bit(Index first, Index count, F&& f) const;

  const NodeTree& tree_;
  std::vector<double> isovalues_;
  std::vector<std::uint64_t> finest_;
  NodeFlags above_;  ///< whether a node of level 0 below is active
  std::uint64_t count_ = 0;
};

}  // namespace isobrick
