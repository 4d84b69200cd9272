#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "stream/resident_bricks.h"
#include "viewer/scene/cut.h"
#include "viewer/scene/device_mesher.h"
#include "viewer/scene/drawable.h"
#include "viewer/scene/slice_image.h"

namespace isobrick::inline v0 {

struct StreamState;

struct StreamOptions {
  int threads = 0;  ///< threads that read, decode and mesh; 0: all cores but one
  std::uint64_t brick_bytes = std::uint64_t{1} << 30;   ///< budget of decoded bricks
  std::uint64_t mesh_bytes = std::uint64_t{1} << 30;    ///< budget of node meshes
  std::uint64_t device_bytes = std::uint64_t{1} << 30;  ///< budget of those on a device
  Vec3d origin;                  ///< world space; subtracted from all positions
  std::optional<Inside> inside;  ///< nullopt: inside_of() the store
  /// Lowers the priority of the worker threads, for other threads of the process.
  bool lower_thread_priority = false;
  /// Called from a worker thread when drawable() may return something new. Must not call the
  /// stream.
  std::function<void()> on_change;
};

/// Totals and state of a stream.
struct StreamCounters {
  double read_seconds = 0, decode_seconds = 0,
         mesh_seconds = 0;       ///< summed over threads, without a device
  std::uint64_t bytes_read = 0;  ///< encoded
  std::uint64_t bricks_resident = 0, brick_bytes = 0, brick_bytes_peak = 0, bricks_read = 0;
  std::uint64_t meshes = 0, mesh_bytes = 0, meshes_made = 0;
  std::uint64_t queue = 0, working = 0;  ///< waiting and running meshes
  std::uint64_t damaged = 0;             ///< of meshes_made: without triangles because of damage
  std::uint64_t device_meshes_made = 0;  ///< of meshes_made: made by a device
  std::uint64_t device_bytes = 0;        ///< of meshes on a device
  std::string device_failure;            ///< why the device failed; or empty
  std::uint64_t triangles_made = 0, blocks_made = 0;  ///< totals of all meshes made
  double triangles_per_block = 0;  ///< of the meshes made; 0 until enough are made
  bool mesh_budget_full = false;   ///< meshes wait because the budget is full
};

/// Makes the meshes of LOD cuts on threads of its own, the most urgent first, and returns what can
/// be drawn meanwhile.
///
/// All functions are thread-safe and wait for neither bricks nor meshes. The destructor releases
/// all bricks and meshes, also those on a device. It waits at most 100 ms for its threads and the
/// device. A thread that is blocked in a read then ends after the read; until then it keeps only
/// the source and the tree alive. Meshes that a device makes later are dropped.
class SceneStream {
 public:
  SceneStream(std::shared_ptr<const BrickSource> source, std::shared_ptr<const NodeTree> tree,
              StreamOptions options);
  ~SceneStream();
  SceneStream(const SceneStream&) = delete;
  SceneStream& operator=(const SceneStream&) = delete;

  /// Sets the cut to make. Running requests that it does not need are cancelled at the next brick.
  void set_cut(const Cut& cut);

  /// The meshes to draw now; the same object until something changes. Until an isovalue covers the
  /// view, the previous isovalue of its index stays visible.
  std::shared_ptr<const Drawable> drawable();
  /// Whether drawable() would return this object.
  bool is_newest(const Drawable& drawable) const;

  /// Sets the device that makes meshes from the data that the threads read; null: the threads make
  /// them. Existing meshes stay. If the device fails, the threads take over; see
  /// StreamCounters::device_failure.
  void set_device(std::shared_ptr<DeviceMesher> device);

  /// Sets the budget of meshes on a device.
  void set_device_budget(std::uint64_t bytes);

  /// Requests a slice for a slot, or clears the slot. Slices come before all meshes.
  void set_slice(int slot, const std::optional<SliceRequest>& request);
  /// The last finished image of a slot; null if there is none.
  std::shared_ptr<const SliceSamples> slice(int slot) const;

  /// Whether nothing is left to do, or nothing can be done.
  bool idle() const;
  /// Waits for idle() at most `seconds`; returns whether it holds.
  bool wait_idle(double seconds) const;

  StreamCounters counters() const;
  /// Number of bricks that waiting meshes need and that are not resident. Takes about as long as
  /// planning.
  std::uint64_t missing_bricks() const;
  /// The resident bricks; thread-safe.
  ResidentBricks& bricks() const;

 private:
  std::shared_ptr<StreamState> state_;
  std::vector<std::thread> threads_;
};

}  // namespace isobrick
