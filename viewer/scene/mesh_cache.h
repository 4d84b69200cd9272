#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "viewer/scene/node_mesh.h"

namespace isobrick {

using MeshPtr = std::shared_ptr<const NodeMesh>;

/// Node meshes under a budget, of all isovalues and borders, the least recently
/// used dropped first. Not thread-safe.
class MeshCache {
 public:
  /// In bytes of host memory, and of a device's for meshes that lie there.
  MeshCache(std::uint64_t budget, std::uint64_t device_budget)
      : budget_(budget), device_budget_(device_budget) {}

  /// The node's mesh with exactly these coarser neighbours, or null.
  MeshPtr find(const NodeKey& key, double isovalue, std::uint32_t coarser);
  /// The same, or else one with other neighbours.
  MeshPtr find_any(const NodeKey& key, double isovalue, std::uint32_t coarser);
  bool has_any(const NodeKey& key, double isovalue) const;
  /// Of all meshes of an isovalue: the finest one's level; above all levels where there is none.
  int finest_level(double isovalue) const;

  void put(MeshPtr mesh);

  /// What is found from now on is kept by the next shrink().
  void begin_use() { ++now_; }
  bool is_within_budgets() const { return bytes_ <= budget_ && device_bytes_ <= device_budget_; }
  /// When a budget is exceeded, drops what was not used since begin_use() until there is
  /// some room again. False when the budgets are exceeded all the same.
  bool shrink();
  /// Drops so many bytes of what lies on the device and was not used since begin_use(), or as much
  /// as there is.
  void shrink_device(std::uint64_t bytes);

  void set_device_budget(std::uint64_t bytes) { device_budget_ = bytes; }
  std::uint64_t device_budget() const { return device_budget_; }

  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t device_bytes() const { return device_bytes_; }
  std::uint64_t meshes() const { return meshes_; }

 private:
  /// What is compared lies here: a mesh is looked at only when it is the one.
  struct Entry {
    std::uint32_t coarser;
    std::uint64_t used;
    MeshPtr mesh;
  };
  struct Surface {
    /// Each node's in the order in which they were made.
    std::unordered_map<NodeKey, std::vector<Entry>, NodeKeyHash> nodes;
    std::map<int, std::size_t> levels;  ///< how many of its nodes lie in each
  };

  std::vector<Entry>* entries_of(const NodeKey& key, double isovalue);
  void drop(const NodeMesh& mesh);
  void drop_until(std::uint64_t bytes, std::uint64_t device_bytes);

  std::uint64_t budget_, device_budget_, bytes_ = 0, device_bytes_ = 0, meshes_ = 0, now_ = 1;
  /// By isovalue: nothing is looked for in many nodes where one is new.
  std::map<double, Surface> surfaces_;
};

}  // namespace isobrick
