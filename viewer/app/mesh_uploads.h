#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "viewer/render/mesh_pool.h"
#include "viewer/scene/drawable.h"

namespace isobrick {

/// Meshes taken from host memory to the device, into a pool that outlives this. Those that are not
/// drawn stay while there is room: they may outlive the ones in host memory, which made again would
/// be the same. For the thread of the context.
class MeshUploads {
 public:
  /// What may be taken to the device in a picture while others wait: copies that a driver puts
  /// off take their time later.
  struct Limit {
    std::uint64_t bytes = 0;
    std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

    bool is_spent() const {
      return bytes > kMaxBytes || std::chrono::steady_clock::now() - begin > kMax;
    }
    static constexpr std::uint64_t kMaxBytes = 16u << 20;
    static constexpr std::chrono::milliseconds kMax{6};
  };

  /// Before the pool grows: meshes that are not used may go, or stay. Where OpenGL is software they
  /// are soon copied again, while new memory is cleared, tens of milliseconds a block.
  enum class UnusedMeshes : std::uint8_t { keep, drop };

  MeshUploads(MeshPool& pool, UnusedMeshes unused) : pool_(pool), unused_(unused) {}
  ~MeshUploads();
  MeshUploads(const MeshUploads&) = delete;
  MeshUploads& operator=(const MeshUploads&) = delete;

  /// From now on what was used before may go.
  void begin_use() { ++use_; }
  /// Uses a picture's meshes and takes those that are not there; false when `limit` (null: without
  /// a limit) was spent before all were. `origin`: world position of (0, 0, 0) in meshes'
  /// coordinates. Throws what MeshPool::add does.
  bool add(const Drawable& drawable, Vec3d origin, Limit* limit);
  /// Uses a picture's meshes that are there.
  void keep(const Drawable& drawable);
  /// Null for what is not there.
  const PooledMesh* find(const NodeMesh& mesh) const;

  /// Drops what is not used, the oldest first, until no more than this is taken.
  void drop(std::uint64_t most);
  /// Device memory that is taken.
  std::uint64_t bytes() const { return pool_.capacity(); }

 private:
  struct Upload {
    bool complete = false;
    PooledMesh mesh;
    std::uint64_t last_use = 0;
    std::optional<MeshCopy> copy;  ///< that has been begun, of `from`
    MeshPtr source;
  };

  bool advance(Upload& upload, Limit* limit);

  /// Those that are not used, the oldest last.
  std::vector<MeshId> unused_ids() const;
  void make_room(const MeshChunk& mesh, std::optional<std::vector<MeshId>>& left);

  MeshPool& pool_;
  UnusedMeshes unused_;
  std::unordered_map<MeshId, Upload, MeshIdHash> uploads_;
  std::uint64_t use_ = 0;
};

}  // namespace isobrick
