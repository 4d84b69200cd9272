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

namespace isobrick::inline v0 {

/// Opens the device that makes meshes, on a thread of its own, and imports its memory into OpenGL.
/// All memory is allocated and imported before the first mesh, one block at a time, since an import
/// may take half the time of a frame. For the thread of the context.
class DeviceOpener {
 public:
  /// `budget`: bytes of device memory for meshes. `on_change` is called from another thread once
  /// the device is open, or has failed to open.
  DeviceOpener(std::uint64_t budget, std::function<void()> on_change)
      : budget_(budget), on_change_(std::move(on_change)) {}

  /// Starts to open the device of the current OpenGL context, if possible; only the first call
  /// does. Throws Error if the context cannot report its device; then has_begun() stays false.
  void begin();
  bool has_begun() const { return mesher_.valid(); }
  /// Whether opening has ended, with or without success; the memory may not be imported yet.
  bool is_open() const;
  /// Whether opening has ended and all memory is imported.
  bool is_done() const;
  /// Waits for is_done(). Returns null if there is no device; throws Error if it cannot be opened.
  std::shared_ptr<DeviceMesher> get();
  /// Imports one block of memory, if the device is open. Returns whether it did.
  bool import_next();

  /// Bytes of device memory for meshes: allocated now, and reserved.
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
  std::jthread opener_;  ///< last member: joined before the others are destroyed
};

/// The device that makes a scene's meshes, and its memory as OpenGL sees it. For the thread of the
/// context.
class DeviceMeshes {
 public:
  DeviceMeshes(SceneStream& stream, std::shared_ptr<DeviceOpener> opener);

  /// Sets the backend. Backend::automatic takes a CUDA device, if there is one, once it is open; it
  /// does not wait. Backend::cuda waits, and throws Error if there is none.
  void use(Backend backend);
  Backend backend() const { return backend_; }
  /// Imports one block of the device's memory, or takes over a device that is complete. Returns
  /// whether it imported a block.
  bool update();
  /// Whether update() has work.
  bool has_work() const { return !taken_over_ && opener_->is_open(); }

  /// Describes what makes meshes, in a line: the device's name and how its meshes reach pictures,
  /// or "CPU" and the reason.
  std::string describe() const;
  /// Whether OpenGL draws the device's meshes from where they were made.
  bool shares_memory() const;

  /// Totals of the device; zero if there is none.
  DeviceMesher::Times times() const { return mesher_ ? mesher_->times() : DeviceMesher::Times{}; }
  /// DeviceMesher::kernel_lock(), if the device makes meshes that are also drawn; else null.
  TicketLock* kernel_lock() const;

  /// Returns a mesh on the device, to draw until release_borrowed(). With shared memory the caller
  /// waits for the end of each picture before it releases meshes, since their space is reused.
  const PooledMesh& borrow(const NodeMesh& mesh, Vec3d origin);
  void release_borrowed() { borrowed_.clear(); }

  /// Bytes of device memory for meshes: allocated now, and reserved.
  std::uint64_t allocated_bytes() const { return opener_->allocated_bytes(); }
  std::uint64_t reserved_bytes() const { return opener_->reserved_bytes(); }

  /// The part of that memory for meshes; fragmentation takes the rest.
  static std::uint64_t cache_bytes(std::uint64_t memory) { return memory / 4 * 3; }

 private:
  void take_over();

  SceneStream& stream_;
  std::shared_ptr<DeviceOpener> opener_;
  Backend backend_ = Backend::cpu;
  std::shared_ptr<DeviceMesher> mesher_;
  bool taken_over_ = false;  ///< or failed to
  std::string failure_;
  std::deque<PooledMesh> borrowed_;
};

}  // namespace isobrick
