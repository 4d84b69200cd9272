#include <isobrick/device_mesh.h>

#include <utility>

#include "gpu/memory/device_scope.h"
#include "gpu/resident/device_mesh_impl.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
void download(std::span<const T> from, PodBuffer<T>& to) {
  to.resize(from.size());
  if (!from.empty())
    gpu::check(cudaMemcpy(to.data(), from.data(), from.size_bytes(), cudaMemcpyDeviceToHost));
}

}  // namespace

DeviceMesh::Impl::Impl(int d, const gpu::Stream& s, gpu::MeshRoom r, const gpu::DeviceCounts& c,
                       std::string u)
    : device(d), stream(s), room(std::move(r)), counts(c), unit(std::move(u)) {
  ready.record(stream);
}

DeviceMesh::Impl::~Impl() {
  const gpu::DeviceScope scope(device);
  room = {};
}

DeviceMesh::DeviceMesh() = default;
DeviceMesh::DeviceMesh(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

std::span<const Vec3f> DeviceMesh::positions() const {
  if (!impl_) return {};
  return {impl_->room.positions.data(), impl_->counts.vertices};
}

std::span<const Vec3f> DeviceMesh::normals() const {
  if (!impl_ || !impl_->room.normals.data()) return {};
  return {impl_->room.normals.data(), impl_->counts.vertices};
}

std::span<const Triangle> DeviceMesh::triangles() const {
  if (!impl_) return {};
  return {impl_->room.triangles.data(), impl_->counts.triangles};
}

int DeviceMesh::device() const { return impl_ ? impl_->device : -1; }
CUstream_st* DeviceMesh::stream() const { return impl_ ? impl_->stream.get() : nullptr; }
CUevent_st* DeviceMesh::ready() const { return impl_ ? impl_->ready.get() : nullptr; }

void DeviceMesh::precede(CUstream_st* stream) const {
  if (!impl_) return;
  const gpu::DeviceScope scope(impl_->device);
  gpu::check(cudaStreamWaitEvent(stream, impl_->ready.get()));
}

Mesh DeviceMesh::download() const {
  Mesh mesh;
  if (!impl_) return mesh;
  const gpu::DeviceScope scope(impl_->device);
  impl_->ready.wait();
  isobrick::download(positions(), mesh.positions);
  isobrick::download(normals(), mesh.normals);
  isobrick::download(triangles(), mesh.triangles);
  mesh.unit = impl_->unit;
  return mesh;
}

}  // namespace isobrick
