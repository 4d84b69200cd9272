#pragma once

#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>

#include <isobrick/extract.h>
#include "viewer/render/imported_buffers.h"
#include "viewer/scene/scene_stream.h"

namespace isobrick {

/// The device that makes meshes, opened once and beside everything else, and its memory as OpenGL
/// sees it. All of that memory is taken and imported before the device makes any mesh, one piece at
/// a time: an import takes as long as half a picture may. For the thread of the context.
class DeviceOpener {
 public:
  /// `budget`: of the device's memory for meshes. `on_change` is called from another thread when
  /// the device is there, or is known not to come.
  DeviceOpener(std::uint64_t budget, std::function<void()> on_change)
      : budget_(budget), on_change_(std::move(on_change)) {}

  /// Unless it has begun: that of the current OpenGL context, if possible. Throws Error, and has
  /// not begun, when that context cannot say which it is.
  void begin();
  bool has_begun() const { return mesher_.valid(); }
  /// Whether the device is there, perhaps without its memory, or is known not to come.
  bool is_open() const;
  /// Whether the device is there with its memory, or is known not to come.
  bool is_done() const;
  /// Waits for that. Null where there is no device; throws Error when it cannot be opened.
  std::shared_ptr<DeviceMesher> get();
  /// Imports one piece of the memory, once it is there. Whether there was one.
  bool import_next();

  /// Device memory for meshes: that is taken, and that may be taken.
  std::uint64_t allocated_bytes() const;
  std::uint64_t reserved_bytes() const;

  const ImportedBuffers& buffers_of(const DeviceBlock& block) const {
    return imported_.at(block.owner.get())->buffers;
  }

 private:
  struct ImportedBlock {
    std::shared_ptr<const void> owner;
    ImportedBuffers buffers;
  };

  DeviceMesher* mesher() const;
  bool import_one(DeviceMesher& mesher);

  std::uint64_t budget_;
  std::function<void()> on_change_;
  std::unordered_map<const void*, std::unique_ptr<ImportedBlock>> imported_;
  std::shared_future<std::shared_ptr<DeviceMesher>> mesher_;
  std::jthread opener_;  ///< last: ends before the others
};

/// The device that makes a picture's meshes, and its memory as OpenGL sees it. For the thread
/// of the picture's context.
class DeviceMeshes {
 public:
  DeviceMeshes(SceneStream& stream, std::shared_ptr<DeviceOpener> opener);

  /// From now on: Backend::automatic takes a CUDA device where there is one, as soon as it is
  /// open, without waiting for it. Backend::cuda waits, and throws Error where there is none.
  void use(Backend backend);
  Backend backend() const { return backend_; }
  /// Takes over a device that has been opened meanwhile; before, imports its memory, a piece with
  /// each call. Whether it has imported one.
  bool update();
  /// Whether update() has something to do.
  bool has_work() const { return !taken_over_ && opener_->is_open(); }

  /// Who makes meshes now, in a line: a device's name and how meshes get into pictures, or
  /// "CPU" and why.
  std::string describe() const;
  /// Whether what a device makes is drawn from where it made it.
  bool shares_memory() const;

  /// What the device has done; nothing where there is none.
  DeviceMesher::Times times() const { return mesher_ ? mesher_->times() : DeviceMesher::Times{}; }
  /// DeviceMesher::kernel_lock(), where the device makes meshes and draws; else null.
  TicketLock* kernel_lock() const;

  /// A mesh on the device, to be drawn until the next release_borrowed(). Where memory is shared,
  /// whoever draws waits for the end of each picture: only then may meshes go, and their places be
  /// given to others.
  const PooledMesh& borrow(const NodeMesh& mesh, Vec3d origin);
  void release_borrowed() { borrowed_.clear(); }

  /// Device memory for meshes that devices make: that is taken, and that may be taken.
  std::uint64_t allocated_bytes() const { return opener_->allocated_bytes(); }
  std::uint64_t reserved_bytes() const { return opener_->reserved_bytes(); }

  /// Of that memory: what is in meshes; the rest falls between.
  static std::uint64_t cache_bytes(std::uint64_t memory) { return memory / 4 * 3; }

 private:
  void take_over();

  SceneStream& stream_;
  std::shared_ptr<DeviceOpener> opener_;
  Backend backend_ = Backend::cpu;
  std::shared_ptr<DeviceMesher> mesher_;
  bool taken_over_ = false;  ///< or tried in vain
  std::string failure_;
  std::deque<PooledMesh> borrowed_;
};

}  // namespace isobrick
