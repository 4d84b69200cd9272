#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "viewer/scene/node_mesh.h"

namespace isobrick::inline v0 {

using MeshPtr = std::shared_ptr<const NodeMesh>;

/// Node meshes of all isovalues and borders within a budget. The least recently used ones are
/// dropped first. Not thread-safe.
class MeshCache {
 public:
  /// Budgets in bytes of host memory, and of device memory for meshes that lie there.
  MeshCache(std::uint64_t budget, std::uint64_t device_budget)
      : budget_(budget), device_budget_(device_budget) {}

  /// The node's mesh with exactly this mask of coarser neighbours, or null.
  MeshPtr find(const NodeKey& key, double isovalue, std::uint32_t coarser);
  /// The same; if there is none, the newest one with another mask.
  MeshPtr find_any(const NodeKey& key, double isovalue, std::uint32_t coarser);
  bool has_any(const NodeKey& key, double isovalue) const;
  /// The finest level that has a mesh of the isovalue; a number above all levels if there is none.
  int finest_level(double isovalue) const;

  void put(MeshPtr mesh);

  /// Meshes that are found from now on are in use: shrink() keeps them.
  void begin_use() { ++use_; }
  bool is_within_budgets() const { return bytes_ <= budget_ && device_bytes_ <= device_budget_; }
  /// If a budget is exceeded, drops unused meshes until there is some room again. Returns false if
  /// the meshes in use alone exceed a budget.
  bool shrink();
  /// Drops unused meshes on the device, `bytes` bytes of them if there are as many.
  void shrink_device(std::uint64_t bytes);

  void set_device_budget(std::uint64_t bytes) { device_budget_ = bytes; }
  std::uint64_t device_budget() const { return device_budget_; }

  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t device_bytes() const { return device_bytes_; }
  std::uint64_t meshes() const { return meshes_; }

 private:
  /// Holds what a search compares, so that it reads only the mesh that it returns.
  struct Entry {
    std::uint32_t coarser;
    std::uint64_t used;
    MeshPtr mesh;
  };
  struct Surface {
    /// The meshes of a node, the newest last.
    std::unordered_map<NodeKey, std::vector<Entry>, NodeKeyHash> nodes;
    std::map<int, std::size_t> levels;  ///< number of nodes on each level
  };

  std::vector<Entry>* entries_of(const NodeKey& key, double isovalue);
  void drop(const NodeMesh& mesh);
  void drop_until(std::uint64_t bytes, std::uint64_t device_bytes);

  std::uint64_t budget_, device_budget_, bytes_ = 0, device_bytes_ = 0, meshes_ = 0, use_ = 1;
  /// By isovalue: a search for a new isovalue ends at once.
  std::map<double, Surface> surfaces_;
};

}  // namespace isobrick
