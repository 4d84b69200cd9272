#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "viewer/render/mesh_pool.h"
#include "viewer/scene/drawable.h"

namespace isobrick::inline v0 {

/// Uploads meshes from host memory to the device, into `pool`, which must outlive this. Unused
/// meshes stay while there is room: if the scene drops and remakes a mesh, it is already on the
/// device. For the thread of the context.
class MeshUploads {
 public:
  /// Limits the uploads of one frame while more meshes wait. A driver may postpone copies, so bytes
  /// count as well as time.
  struct Limit {
    std::uint64_t bytes = 0;
    std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

    bool is_spent() const {
      return bytes > kMaxBytes || std::chrono::steady_clock::now() - begin > kMax;
    }
    static constexpr std::uint64_t kMaxBytes = 16u << 20;
    static constexpr std::chrono::milliseconds kMax{6};
  };

  /// Whether unused meshes are dropped before the pool grows. In software that is faster: a copy is
  /// cheap, but clearing a new block takes tens of milliseconds.
  enum class UnusedMeshes : std::uint8_t { keep, drop };

  MeshUploads(MeshPool& pool, UnusedMeshes unused) : pool_(pool), unused_(unused) {}
  ~MeshUploads();
  MeshUploads(const MeshUploads&) = delete;
  MeshUploads& operator=(const MeshUploads&) = delete;

  /// Meshes used before this call may be dropped.
  void begin_use() { ++use_; }
  /// Marks the meshes as used and uploads those that are missing. Returns false if `limit` (null:
  /// none) was spent before all were uploaded. `origin`: world position of (0, 0, 0) in the meshes'
  /// coordinates. Throws what MeshPool::add throws.
  bool add(const Drawable& drawable, Vec3d origin, Limit* limit);
  /// Marks the meshes that are on the device as used.
  void keep(const Drawable& drawable);
  /// The uploaded mesh, or null.
  const PooledMesh* find(const NodeMesh& mesh) const;

  /// Drops unused meshes, the oldest first, until the pool has at most `max_bytes`.
  void drop(std::uint64_t max_bytes);
  /// Bytes of device memory.
  std::uint64_t bytes() const { return pool_.capacity(); }

 private:
  struct Upload {
    bool complete = false;
    PooledMesh mesh;
    std::uint64_t last_use = 0;
    std::optional<MeshCopy> copy;  ///< of `source`, in progress
    MeshPtr source;
  };

  bool advance(Upload& upload, Limit* limit);

  /// Unused meshes, the oldest last.
  std::vector<MeshId> unused_ids() const;
  void make_room(const MeshChunk& mesh, std::optional<std::vector<MeshId>>& left);

  MeshPool& pool_;
  UnusedMeshes unused_;
  std::unordered_map<MeshId, Upload, MeshIdHash> uploads_;
  std::uint64_t use_ = 0;
};

}  // namespace isobrick
