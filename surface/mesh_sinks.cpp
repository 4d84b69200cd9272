#include <isobrick/mesh_sinks.h>

#include <cstring>

#include "surface/surface_extractor.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
void append(PodBuffer<T>& to, std::span<const T> items) {
  const std::size_t before = to.size();
  to.resize(before + items.size());
  if (!items.empty()) std::memcpy(to.data() + before, items.data(), items.size_bytes());
}

}  // namespace

void MemorySink::begin(const MeshHeader& header) {
  mesh_.clear();
  mesh_.unit = header.unit;
}

void MemorySink::write(const MeshChunk& chunk) {
  append(mesh_.positions, chunk.positions);
  append(mesh_.normals, chunk.normals);
  append(mesh_.triangles, chunk.triangles);
}

std::uint64_t MemorySink::bytes() const {
  return mesh_bytes({mesh_.positions.size(), mesh_.triangles.size()}, !mesh_.normals.empty());
}

void FunctionSink::write(const MeshChunk& chunk) {
  function_(chunk);
  bytes_ += mesh_bytes({chunk.positions.size(), chunk.triangles.size()}, !chunk.normals.empty());
}

}  // namespace isobrick
