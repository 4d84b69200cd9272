#pragma once

#include <cstdint>

#include "core/thread_annotations.h"
#include "viewer/scene/node_mesh.h"

namespace isobrick::inline v0 {

/// Totals of the meshes that were made. Thread-safe.
class MeshStatistics {
 public:
  struct Totals {
    std::uint64_t meshes = 0, by_device = 0, damaged = 0;
    std::uint64_t triangles = 0, blocks = 0;
    double seconds = 0;  ///< of meshing, summed over threads, without a device

    /// 0 until enough blocks were meshed.
    double triangles_per_block() const {
      if (blocks < kMeasuredBlocks) return 0;
      return static_cast<double>(triangles) / static_cast<double>(blocks);
    }
  };

  /// Adds a mesh of `blocks` active blocks.
  void add(const NodeMesh& mesh, int blocks, bool by_device) {
    const MutexLock lock(mutex_);
    ++totals_.meshes;
    totals_.by_device += by_device ? 1 : 0;
    totals_.damaged += mesh.damage.empty() ? 0 : 1;
    totals_.triangles += mesh.triangles();
    totals_.blocks += static_cast<std::uint64_t>(blocks);
  }
  /// Adds meshing time of a thread.
  void add_seconds(double seconds) {
    const MutexLock lock(mutex_);
    totals_.seconds += seconds;
  }
  Totals totals() const {
    const MutexLock lock(mutex_);
    return totals_;
  }

 private:
  /// A few coarse meshes are not representative.
  static constexpr std::uint64_t kMeasuredBlocks = 512;

  mutable Mutex mutex_;
  Totals totals_ ISOBRICK_GUARDED_BY(mutex_);
};

}  // namespace isobrick
