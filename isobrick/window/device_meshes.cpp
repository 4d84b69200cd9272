#include "isobrick/window/device_meshes.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "isobrick/core/error.h"
#include "isobrick/pipeline/gpu_backend.h"

namespace isobrick {

/// What may still be in use by drawing calls that were made before.
struct DeviceMeshes::Retired {
  explicit Retired(std::shared_ptr<const Drawable> d)
      : drawn(std::move(d)), end(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)) {}
  ~Retired() { glDeleteSync(end); }
  Retired(const Retired&) = delete;
  Retired& operator=(const Retired&) = delete;
  bool over() const {
    const GLenum state = glClientWaitSync(end, 0, 0);
    return state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED;
  }

  std::shared_ptr<const Drawable> drawn;
  GLsync end;
};

void DeviceOpening::begin() {
  if (begun()) return;
  mesher_ = std::async(std::launch::async, [id = current_gl_device_id(), budget = budget_,
                                            changed = on_change_] {
              auto mesher = open_device_mesher(id, budget);
              if (changed) changed();
              return mesher;
            }).share();
}

const ImportedBuffers& DeviceOpening::buffers_of(const DeviceBlock& block) {
  if (const auto there = imported_.find(block.owner.get()); there != imported_.end())
    return there->second->buffers;
  auto imported = std::unique_ptr<Imported>(
      new Imported{block.owner, {block.file, block.bytes, block.vertices, block.triangles}});
  return imported_.emplace(block.owner.get(), std::move(imported)).first->second->buffers;
}

bool DeviceOpening::over() const {
  return begun() && mesher_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

DeviceMeshes::DeviceMeshes(SceneStream& stream, std::shared_ptr<DeviceOpening> opening)
    : stream_(stream), opening_(std::move(opening)) {}

DeviceMeshes::~DeviceMeshes() {
  // Memory that is drawn from must not be given to others meanwhile.
  if (!retired_.empty()) glFinish();
}

void DeviceMeshes::use(Backend backend) {
  const bool must = backend == Backend::cuda;
  if (must && !built_with_cuda())
    throw Error("--backend cuda: this isobrick was built without CUDA; use --backend cpu");
  backend_ = backend;
  if (backend == Backend::cpu) return stream_.set_device(nullptr);
  opening_->begin();
  if (opened_)
    stream_.set_device(mesher_);
  else if (must || opening_->over())
    take_over();
  if (mesher_ && !mesher_->failure().empty()) failure_ = mesher_->failure();
  if (!must || (mesher_ && failure_.empty())) return;
  backend_ = Backend::cpu;
  throw Error(failure_.empty() ? "--backend cuda: there is no CUDA device here; use --backend cpu"
                               : failure_);
}

void DeviceMeshes::update() {
  if (!opened_ && opening_->over())
    take_over();
  else if (mesher_)
    import_one();
}

/// Memory that has been added: before it is drawn from, and not much of it with one picture.
void DeviceMeshes::import_one() {
  for (const DeviceBlock& block : mesher_->shared_blocks()) {
    if (opening_->imported(block)) continue;
    try {
      opening_->buffers_of(block);
    } catch (const Error&) {
      // Where the first one is refused, all are. Later ones say so where they are drawn.
      if (!opening_->any_imported()) mesher_->share_nothing();
    }
    return;
  }
}

void DeviceMeshes::take_over() {
  opened_ = true;
  try {
    mesher_ = opening_->get();
  } catch (const Error& e) {
    failure_ = e.what();
  }
  if (!mesher_) return;
  import_one();
  if (backend_ != Backend::cpu) stream_.set_device(mesher_);
}

Turns* DeviceMeshes::turns() const {
  const bool makes = backend_ != Backend::cpu && shares_memory() && mesher_->failure().empty();
  return makes ? &mesher_->turns() : nullptr;
}

bool DeviceMeshes::shares_memory() const { return mesher_ && !mesher_->shared_blocks().empty(); }

std::string DeviceMeshes::describe() const {
  const std::string failure = stream_.counters().device_failure;
  if (!failure.empty()) return fmt::format("CPU ({})", failure);
  if (backend_ == Backend::cpu) return "CPU";
  if (mesher_)
    return fmt::format("{}{}", mesher_->name(),
                       shares_memory() ? ", into OpenGL's buffers" : ", through host memory");
  if (!failure_.empty()) return fmt::format("CPU ({})", failure_);
  return opened_ ? "CPU (there is no CUDA device)" : "CPU";
}

const PooledMesh& DeviceMeshes::drawn(const NodeMesh& mesh, Vec3d origin) {
  const DeviceMesh& there = *mesh.device;
  const MeshPlace place =
      opening_->buffers_of(there.block)
          .place(there.first_vertex, there.vertices, there.first_triangle, there.triangles);
  return borrowed_.emplace_back(MeshPool::borrow(place, origin));
}

void DeviceMeshes::retire(std::shared_ptr<const Drawable> drawn) {
  while (!retired_.empty() && retired_.front()->over()) retired_.pop_front();
  if (drawn != nullptr && mesher_) retired_.push_back(std::make_unique<Retired>(std::move(drawn)));
}

}  // namespace isobrick
