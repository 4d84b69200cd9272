#include "isobrick/window/mesh_uploads.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace isobrick {

MeshUploads::~MeshUploads() {
  uploads_.clear();
  pool_.tidy();
}

bool MeshUploads::add(const Drawable& drawable, Vec3d origin, Share* share) {
  for (const DrawnNode& node : drawable.nodes) {
    if (node.mesh->device) continue;
    Upload& upload = uploads_[node.mesh->id()];
    upload.used = now_;
    if (upload.there) continue;
    if (share != nullptr && share->spent()) return false;
    if (!node.mesh->empty()) {
      make_room(node.mesh->mesh.chunk(0));
      upload.place = pool_.add(node.mesh->mesh.chunk(0), origin);
      if (share != nullptr) share->bytes += upload.place.bytes();
    }
    upload.there = true;
  }
  return true;
}

void MeshUploads::keep(const Drawable& drawable) {
  for (const DrawnNode& node : drawable.nodes) {
    if (node.mesh->device) continue;
    if (const auto upload = uploads_.find(node.mesh->id()); upload != uploads_.end())
      upload->second.used = now_;
  }
}

const PooledMesh* MeshUploads::find(const NodeMesh& mesh) const {
  const auto upload = uploads_.find(mesh.id());
  return upload == uploads_.end() ? nullptr : &upload->second.place;
}

template <class F>
void MeshUploads::drop_until(F&& enough) {
  if (enough()) return;
  std::vector<std::pair<std::uint64_t, MeshId>> oldest;
  for (const auto& [id, upload] : uploads_)
    if (upload.used != now_) oldest.emplace_back(upload.used, id);
  std::sort(oldest.begin(), oldest.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, id] : oldest) {
    uploads_.erase(id);
    if (enough()) return;
  }
}

void MeshUploads::drop(std::uint64_t most) {
  drop_until([&] {
    if (pool_.capacity() > most) pool_.trim();
    return pool_.capacity() <= most;
  });
}

void MeshUploads::make_room(const MeshChunk& mesh) {
  if (unused_ == Unused::go) drop_until([&] { return pool_.has_room(mesh); });
}

}  // namespace isobrick
