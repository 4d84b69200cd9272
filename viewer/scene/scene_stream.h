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

namespace isobrick {

struct StreamState;

struct StreamOptions {
  int threads = 0;  ///< that read, decode and mesh; 0: all cores but one
  std::uint64_t brick_bytes = std::uint64_t{1} << 30;   ///< budget of decoded bricks
  std::uint64_t mesh_bytes = std::uint64_t{1} << 30;    ///< budget of node meshes
  std::uint64_t device_bytes = std::uint64_t{1} << 30;  ///< budget of those on a device
  Vec3d origin;                  ///< world space; subtracted from all positions
  std::optional<Inside> inside;  ///< nothing: as inside_of() the store
  /// Whether the threads give way to others of the process where cores are short.
  bool lower_thread_priority = false;
  /// Called from a worker's thread whenever drawable() may give something new. Must
  /// not call the stream.
  std::function<void()> on_change;
};

/// What a stream has done so far and has before it.
struct StreamCounters {
  double read_seconds = 0, decode_seconds = 0,
         mesh_seconds = 0;       ///< summed over threads; no device
  std::uint64_t bytes_read = 0;  ///< encoded
  std::uint64_t bricks_resident = 0, brick_bytes = 0, brick_bytes_peak = 0, bricks_read = 0;
  std::uint64_t meshes = 0, mesh_bytes = 0, meshes_made = 0;
  std::uint64_t queue = 0, working = 0;  ///< meshes that wait, that are being made
  std::uint64_t damaged = 0;             ///< of meshes_made, without triangles for that reason
  std::uint64_t device_meshes_made = 0;  ///< of meshes_made, by a device
  std::uint64_t device_bytes = 0;        ///< of meshes on a device
  std::string device_failure;            ///< why the device makes no more meshes; or empty
  std::uint64_t triangles_made = 0, blocks_made = 0;  ///< by all meshes, and in such blocks
  double triangles_per_block = 0;                     ///< of the meshes made; 0: too few yet
  bool mesh_budget_full = false;                      ///< meshes are not made for lack of room
};

/// Makes the meshes of cuts on threads of its own, the most urgent first, and says
/// what can be drawn meanwhile.
///
/// All functions may be called from any thread; none of them waits for a brick or a
/// mesh. The destructor gives back all bricks and meshes, those of a device included, but for
/// those that others hold. It waits for its threads and for what a device makes for it, but no
/// longer than 100 ms: a thread that is held up in a read then ends by itself when the read does,
/// and keeps the source and the tree alive until then, nothing else; what a device makes
/// meanwhile is dropped.
class SceneStream {
 public:
  SceneStream(std::shared_ptr<const BrickSource> source, std::shared_ptr<const NodeTree> tree,
              StreamOptions options);
  ~SceneStream();
  SceneStream(const SceneStream&) = delete;
  SceneStream& operator=(const SceneStream&) = delete;

  /// From now on this is wanted. Work that it does not need is abandoned at the next brick.
  void set_cut(const Cut& cut);

  /// What to draw now. The same object until something changes. Until an isovalue covers the
  /// view, what the one in its place showed before is kept.
  std::shared_ptr<const Drawable> drawable();
  /// Whether drawable() would give this one, without making another.
  bool is_newest(const Drawable& drawable) const;

  /// From now on this device makes meshes of what the threads read; null: the threads do. What
  /// has been made stays. Where it fails the threads go on alone; see
  /// StreamCounters::device_failure.
  void set_device(std::shared_ptr<DeviceMesher> device);

  /// Another budget of meshes on a device.
  void set_device_budget(std::uint64_t bytes);

  /// From now on this slice is wanted in place `slot`, or none; before all meshes.
  void set_slice(int slot, const std::optional<SliceRequest>& request);
  /// The image of that place: the last one that is finished, until the wanted one is.
  /// Null while there is none.
  std::shared_ptr<const SliceSamples> slice(int slot) const;

  /// Whether nothing is left to be done, or nothing can be.
  bool idle() const;
  /// Waits for that at most so long.
  bool wait_idle(double seconds) const;

  StreamCounters counters() const;
  /// Bricks that meshes need which wait to be made, and that are not there. Takes about as long as
  /// to plan them.
  std::uint64_t missing_bricks() const;
  /// The decoded bricks; thread-safe by itself.
  ResidentBricks& bricks() const;

 private:
  std::shared_ptr<StreamState> state_;
  std::vector<std::thread> threads_;
};

}  // namespace isobrick
