#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "isobrick/viewer/scene_stream.h"
#include "isobrick/viewer/stream_plan.h"

// What scene_stream.cpp (what is wanted and what is shown) and stream_work.cpp (the threads)
// share.

namespace isobrick {

/// Work that a thread is at: a mesh, or the slice of a place.
class Running final : public Wanted {
 public:
  explicit Running(MeshJob j) : job(std::move(j)) {}
  Running(int place, const SliceRequest& r) : slot(place), request(r) {}
  void check() const override {
    if (abandoned.load(std::memory_order_relaxed)) throw Abandoned();
  }
  MeshJob job;
  std::optional<int> slot;
  SliceRequest request;
  std::atomic<bool> abandoned = false;
  std::atomic<bool> sent = false;  ///< to a device, which makes it whatever comes
};

/// A place for a slice.
struct Slot {
  std::optional<SliceRequest> wanted;  ///< and not yet being read
  std::shared_ptr<Running> running;
  std::shared_ptr<const SliceSamples> image;
};

/// Outlives the stream for as long as a thread is held up in a read, or a device in making what it
/// was sent; then `stop` is set, and neither meshes nor a device are here any more.
struct SceneStream::Shared : std::enable_shared_from_this<SceneStream::Shared> {
  using Clock = std::chrono::steady_clock;

  std::shared_ptr<const BrickSource> source;
  std::shared_ptr<const NodeTree> tree;
  StreamOptions options;
  ResidentBricks bricks;
  NodeMesher planner;  ///< only asked what it needs

  mutable std::mutex mutex;
  std::condition_variable work;
  mutable std::condition_variable change;
  bool stop = false;
  int alive = 0;  ///< threads
  int calls = 0;  ///< of options.on_change
  std::vector<std::thread> threads;

  Cut cut;
  std::optional<CutIndex> index;
  std::vector<MeshJob> jobs;  ///< the most urgent last
  std::vector<std::shared_ptr<Running>> running;
  std::shared_ptr<DeviceMesher> device;
  MeshCache meshes;
  bool full = false;
  std::uint64_t version = 0;
  std::shared_ptr<const Drawable> drawn;  ///< null: out of date
  std::uint64_t drawn_version = 0;
  std::map<int, Slot> slots;
  StreamCounters counters;
  std::uint64_t triangles_made = 0, blocks_made = 0;
  double seconds_per_job = 0.003;                   ///< of a thread's time: a guess, then a mean
  std::optional<Clock::time_point> last_isovalue;   ///< when another one was last asked for
  bool changed_twice = false;                       ///< and another one shortly before
  std::optional<Clock::time_point> straight_until;  ///< then coarser levels are wanted after all
  std::vector<std::vector<DrawnNode>> shown;        ///< what each isovalue's place shows

  Shared(std::shared_ptr<const BrickSource> s, std::shared_ptr<const NodeTree> t, StreamOptions o)
      : source(std::move(s)),
        tree(std::move(t)),
        options(std::move(o)),
        bricks(source, options.brick_bytes),
        planner(tree->grid(), bricks, options.origin, options.inside),
        meshes(options.mesh_bytes, options.device_bytes) {}

  // All but run(), has_device(), send(), mesh_of() and received() need the lock; those that are
  // given one give it up meanwhile.

  // scene_stream.cpp
  /// Abandons what is not wanted any more. `late`: finer meshes have not come soon enough.
  void plan(bool late = false);
  void keep_shown();
  void make_room();
  void rebuild_drawable();
  void show_before(std::size_t place);

  // stream_work.cpp
  bool has_work() const;
  bool idle() const;
  void run();
  std::shared_ptr<Running> take(std::unique_lock<std::mutex>& lock);
  std::shared_ptr<Running> take_slice();
  void make_mesh(NodeMesher& mesher, const std::shared_ptr<Running>& r,
                 std::unique_lock<std::mutex>& lock);
  void make_slice(const std::shared_ptr<Running>& r, std::unique_lock<std::mutex>& lock);
  std::optional<NodeMesh> mesh_of(NodeMesher& mesher, const std::shared_ptr<Running>& r);
  bool has_device() const;
  bool send(const GridView& grid, const std::shared_ptr<Running>& r);
  void received(const std::shared_ptr<Running>& r, NodeMesh&& mesh, const std::string& failure,
                std::shared_ptr<DeviceMesher> by);
  void take_over(const Running& done, NodeMesh&& mesh, const DeviceMesher& by);
  void give_up(const std::shared_ptr<DeviceMesher>& failed, const std::string& failure);
  void publish(const Running& done, NodeMesh&& mesh);
  void finish(const std::shared_ptr<Running>& r, bool changed, std::unique_lock<std::mutex>& lock);
};

}  // namespace isobrick
