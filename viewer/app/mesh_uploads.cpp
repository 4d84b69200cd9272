#include "viewer/app/mesh_uploads.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {
namespace {

/// Bytes of one copy. While a driver is busy, allocating memory for a megabyte takes it some
/// milliseconds.
constexpr std::uint64_t kCopyBytes = 256 << 10;

}  // namespace

MeshUploads::~MeshUploads() {
  uploads_.clear();
  pool_.trim_but_one();
}

bool MeshUploads::add(const Drawable& drawable, Vec3d origin, Limit* limit) {
  keep(drawable);  // marks later meshes as used, too
  std::optional<std::vector<MeshId>> left;
  for (const NodeDraw& node : drawable.nodes) {
    if (node.mesh->device) continue;
    Upload& upload = uploads_[node.mesh->id()];
    upload.last_use = use_;
    if (upload.complete) continue;
    if (limit != nullptr && limit->is_spent()) return false;
    if (!node.mesh->empty() && !upload.copy) {
      make_room(node.mesh->mesh.chunk(0), left);
      upload.copy = pool_.begin(node.mesh->mesh.chunk(0), origin);
      upload.source = node.mesh;
    }
    if (!advance(upload, limit)) return false;
  }
  return true;
}

/// Returns false if `limit` was spent before the mesh was complete.
bool MeshUploads::advance(Upload& upload, Limit* limit) {
  while (upload.copy && !upload.copy->done()) {
    if (limit != nullptr && limit->is_spent()) return false;
    const std::uint64_t before = upload.copy->bytes_left();
    upload.copy->advance(kCopyBytes);
    if (limit != nullptr) limit->bytes += before - upload.copy->bytes_left();
  }
  if (upload.copy) upload.mesh = upload.copy->take();
  upload.copy.reset();
  upload.source.reset();
  upload.complete = true;
  return true;
}

void MeshUploads::keep(const Drawable& drawable) {
  for (const NodeDraw& node : drawable.nodes) {
    if (node.mesh->device) continue;
    if (const auto upload = uploads_.find(node.mesh->id()); upload != uploads_.end())
      upload->second.last_use = use_;
  }
}

const PooledMesh* MeshUploads::find(const NodeMesh& mesh) const {
  const auto upload = uploads_.find(mesh.id());
  return upload == uploads_.end() ? nullptr : &upload->second.mesh;
}

std::vector<MeshId> MeshUploads::unused_ids() const {
  std::vector<std::pair<std::uint64_t, MeshId>> found;
  for (const auto& [id, upload] : uploads_)
    if (upload.last_use != use_) found.emplace_back(upload.last_use, id);
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<MeshId> ids;
  for (const auto& [used, id] : found) ids.push_back(id);
  return ids;
}

void MeshUploads::drop(std::uint64_t max_bytes) {
  if (pool_.capacity() <= max_bytes) return;
  pool_.trim();
  for (std::vector<MeshId> left = unused_ids(); pool_.capacity() > max_bytes && !left.empty();
       left.pop_back(), pool_.trim())
    uploads_.erase(left.back());
}

/// `left`: the unused meshes, once they have been listed.
void MeshUploads::make_room(const MeshChunk& mesh, std::optional<std::vector<MeshId>>& left) {
  if (unused_ == UnusedMeshes::keep || !pool_.shares_block(mesh)) return;
  while (!pool_.has_room(mesh)) {
    if (!left) left = unused_ids();
    if (left->empty()) return;
    uploads_.erase(left->back());
    left->pop_back();
  }
}

}  // namespace isobrick
