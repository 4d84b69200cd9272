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

namespace isobrick {

/// Bytes as somebody reads them: "1.5 KiB", "3.0 MiB".
std::string size_text(std::uint64_t bytes);

/// Finds the active nodes of isovalues through an index of the finest nodes' ranges, of
/// any kind; all kinds find the same. Another kind is built by a thread of its own while
/// the one before goes on answering. find() and found() are for one thread at a time, the rest is
/// thread-safe.
class NodeSearch {
 public:
  /// Begins with a linear scan. `type` is that of the samples. Indices that need more
  /// than `max_bytes`, what stays and what building takes, are refused. `on_change` is
  /// called from the building thread when there is another index, or it was refused.
  NodeSearch(std::shared_ptr<const NodeTree> tree, ScalarType type, std::uint64_t max_bytes,
             std::function<void()> on_change);
  /// Waits for an index that is being built.
  ~NodeSearch();

  /// The most that any kind takes while it is built for so many nodes.
  static std::uint64_t building_bytes(std::uint64_t nodes);

  /// Searches through this kind from when it is built.
  void use(IndexKind kind);
  /// Until the kind that was asked for last is built or refused.
  void wait();

  /// The nodes that any of the isovalues crosses. Until the next call.
  const ActiveNodes& find(std::span<const double> isovalues);
  /// Whether that is what the call before gave, by the same index.
  bool found(std::span<const double> isovalues) const;

  struct State {
    IndexKind kind = IndexKind::linear;  ///< what answers now
    bool building = false;               ///< another one is on its way
    std::uint64_t bytes = 0;             ///< of the index
    double build_seconds = 0;
    double search_seconds = 0;            ///< of the last search, through all its isovalues
    std::uint64_t active = 0, nodes = 0;  ///< found by it, of so many of the finest level
    std::string refused;                  ///< why the kind that was asked for is not used
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

  // Of find() alone.
  ActiveNodes active_;
  std::shared_ptr<const Bytes> searched_;  ///< the index that active_ comes from

  std::thread builder_;
};

}  // namespace isobrick
