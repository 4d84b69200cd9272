#pragma once

#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>

#include "isobrick/pipeline/extract.h"
#include "isobrick/render/imported_buffers.h"
#include "isobrick/viewer/scene_stream.h"

namespace isobrick {

/// The device that makes meshes, opened once and beside everything else, and its memory as OpenGL
/// sees it. For the thread of the context.
class DeviceOpening {
 public:
  /// `budget`: of the device's memory for meshes. `on_change` is called from another thread when
  /// the device is there.
  DeviceOpening(std::uint64_t budget, std::function<void()> on_change)
      : budget_(budget), on_change_(std::move(on_change)) {}

  /// Unless it has begun: that of the current OpenGL context, if possible.
  void begin();
  bool begun() const { return mesher_.valid(); }
  bool over() const;
  /// Waits for it. Null where there is no device; throws Error when it cannot be opened.
  std::shared_ptr<DeviceMesher> get() const { return mesher_.get(); }

  /// Imported when it is first asked for, which takes some milliseconds. Throws Error when it
  /// cannot be.
  const ImportedBuffers& buffers_of(const DeviceBlock& block);
  bool imported(const DeviceBlock& block) const { return imported_.contains(block.owner.get()); }
  bool any_imported() const { return !imported_.empty(); }

 private:
  struct Imported {
    std::shared_ptr<const void> owner;
    ImportedBuffers buffers;
  };

  std::uint64_t budget_;
  std::function<void()> on_change_;
  std::shared_future<std::shared_ptr<DeviceMesher>> mesher_;
  std::unordered_map<const void*, std::unique_ptr<Imported>> imported_;
};

/// The device that makes a picture's meshes, and its memory as OpenGL sees it. For the thread
/// of the picture's context.
class DeviceMeshes {
 public:
  DeviceMeshes(SceneStream& stream, std::shared_ptr<DeviceOpening> opening);
  ~DeviceMeshes();

  /// From now on: Backend::automatic takes a CUDA device where there is one, as soon as it is
  /// open, without waiting for it. Backend::cuda waits, and throws Error where there is none.
  void use(Backend backend);
  Backend backend() const { return backend_; }
  /// Takes over a device that has been opened meanwhile.
  void update();

  /// Who makes meshes now, in a line: a device's name and how meshes get into pictures, or
  /// "CPU" and why.
  std::string describe() const;
  /// Whether what a device makes is drawn from where it made it.
  bool shares_memory() const;

  /// What the device has done; nothing where there is none.
  DeviceMesher::Times times() const { return mesher_ ? mesher_->times() : DeviceMesher::Times{}; }
  /// The device's turns, where it makes meshes and draws; else null.
  Turns* turns() const;

  /// A mesh on the device, to be drawn until the next forget().
  const PooledMesh& drawn(const NodeMesh& mesh, Vec3d origin);
  void forget() { borrowed_.clear(); }
  /// These are not drawn from here on; kept until the device has drawn what it was told.
  void retire(std::shared_ptr<const Drawable> drawn);

 private:
  struct Retired;
  void take_over();
  void import_one();

  SceneStream& stream_;
  std::shared_ptr<DeviceOpening> opening_;
  Backend backend_ = Backend::cpu;
  std::shared_ptr<DeviceMesher> mesher_;
  bool opened_ = false;  ///< or tried in vain
  std::string failure_;
  std::deque<PooledMesh> borrowed_;
  std::deque<std::unique_ptr<Retired>> retired_;
};

}  // namespace isobrick
