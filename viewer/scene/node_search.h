#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/scalar.h>
#include "core/thread_annotations.h"
#include "viewer/scene/active_nodes.h"
#include "viewer/scene/node_tree.h"

namespace isobrick::inline v0 {

/// Formats a number of bytes: "1.5 KiB", "3.0 MiB".
std::string size_text(std::uint64_t bytes);

/// Finds the active nodes of isovalues through an index over the ranges of the finest nodes. All
/// kinds of index find the same nodes. A thread of its own builds another kind while the present
/// one answers. find() and is_current() are for one thread at a time; the rest is thread-safe.
class NodeSearch {
 public:
  /// Starts with a linear scan. `type`: of the samples. An index that needs more than `max_bytes`
  /// in all, while it is built, is refused. The builder thread calls `on_change` when it has built
  /// or refused an index.
  NodeSearch(std::shared_ptr<const NodeTree> tree, ScalarType type, std::uint64_t max_bytes,
             std::function<void()> on_change);
  /// Waits for the builder thread.
  ~NodeSearch();

  /// Maximum bytes that any kind needs while it is built for `nodes` nodes.
  static std::uint64_t building_bytes(std::uint64_t nodes);

  /// Builds an index of this kind, then searches through it.
  void use(IndexKind kind);
  /// Waits until the last requested kind is built or refused.
  void wait();

  /// Returns the nodes that any of the isovalues crosses. Valid until the next call.
  const ActiveNodes& find(std::span<const double> isovalues);
  /// Whether the last find() was for these isovalues, through the present index.
  bool is_current(std::span<const double> isovalues) const;

  struct State {
    IndexKind kind = IndexKind::linear;  ///< of the index in use
    bool building = false;               ///< another index is being built
    std::uint64_t bytes = 0;             ///< of the index
    double build_seconds = 0;
    double search_seconds = 0;            ///< of the last search, for all its isovalues
    std::uint64_t active = 0, nodes = 0;  ///< found, and all of the finest level
    std::string refused;                  ///< why the requested kind is not used; or empty
  };
  State state() const;

 private:
  using Bytes = std::vector<std::byte>;

  static std::uint64_t building_bytes(IndexKind kind, std::uint64_t nodes);
  std::shared_ptr<const Bytes> index() const;
  Bytes build(IndexKind kind) const;
  void set_index(IndexKind kind, Bytes bytes, double seconds) ISOBRICK_REQUIRES(mutex_);
  void build_requested();
  std::optional<IndexKind> next_to_build();
  bool finish_building(IndexKind kind, std::optional<Bytes> built, double seconds,
                       std::string refused);

  std::shared_ptr<const NodeTree> tree_;
  ScalarType type_;
  std::uint64_t max_bytes_;
  std::function<void()> on_change_;

  mutable Mutex mutex_;
  CondVar change_;
  bool stop_ ISOBRICK_GUARDED_BY(mutex_) = false;
  IndexKind requested_ ISOBRICK_GUARDED_BY(mutex_) = IndexKind::linear;
  std::shared_ptr<const Bytes> index_ ISOBRICK_GUARDED_BY(mutex_);
  State state_ ISOBRICK_GUARDED_BY(mutex_);

  // Only find() and is_current() use these.
  ActiveNodes active_;
  std::shared_ptr<const Bytes> searched_;  ///< index that gave active_

  std::thread builder_;
};

}  // namespace isobrick
