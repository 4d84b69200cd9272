#include "viewer/app/mesh_uploads.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace isobrick {
namespace {

/// Bytes that are copied at a time: where a driver gets memory for copies while something else
/// holds it up, a megabyte takes it some milliseconds.
constexpr std::uint64_t kCopyBytes = 256 << 10;

}  // namespace

MeshUploads::~MeshUploads() {
  uploads_.clear();
  pool_.tidy();
}

bool MeshUploads::add(const Drawable& drawable, Vec3d origin, Share* share) {
  keep(drawable);  // what comes further on is used, too
  std::optional<std::vector<MeshId>> left;
  for (const NodeDraw& node : drawable.nodes) {
    if (node.mesh->device) continue;
    Upload& upload = uploads_[node.mesh->id()];
    upload.used = now_;
    if (upload.there) continue;
    if (share != nullptr && share->spent()) return false;
    if (!node.mesh->empty() && !upload.copy) {
      make_room(node.mesh->mesh.chunk(0), left);
      upload.copy = pool_.begin(node.mesh->mesh.chunk(0), origin);
      upload.from = node.mesh;
    }
    if (!advance(upload, share)) return false;
  }
  return true;
}

/// False when `share` was spent before it was there.
bool MeshUploads::advance(Upload& upload, Share* share) {
  while (upload.copy && !upload.copy->done()) {
    if (share != nullptr && share->spent()) return false;
    const std::uint64_t before = upload.copy->bytes_left();
    upload.copy->advance(kCopyBytes);
    if (share != nullptr) share->bytes += before - upload.copy->bytes_left();
  }
  if (upload.copy) upload.place = upload.copy->take();
  upload.copy.reset();
  upload.from.reset();
  upload.there = true;
  return true;
}

void MeshUploads::keep(const Drawable& drawable) {
  for (const NodeDraw& node : drawable.nodes) {
    if (node.mesh->device) continue;
    if (const auto upload = uploads_.find(node.mesh->id()); upload != uploads_.end())
      upload->second.used = now_;
  }
}

const PooledMesh* MeshUploads::find(const NodeMesh& mesh) const {
  const auto upload = uploads_.find(mesh.id());
  return upload == uploads_.end() ? nullptr : &upload->second.place;
}

std::vector<MeshId> MeshUploads::unused() const {
  std::vector<std::pair<std::uint64_t, MeshId>> found;
  for (const auto& [id, upload] : uploads_)
    if (upload.used != now_) found.emplace_back(upload.used, id);
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<MeshId> ids;
  for (const auto& [used, id] : found) ids.push_back(id);
  return ids;
}

void MeshUploads::drop(std::uint64_t most) {
  if (pool_.capacity() <= most) return;
  pool_.trim();
  for (std::vector<MeshId> left = unused(); pool_.capacity() > most && !left.empty();
       left.pop_back(), pool_.trim())
    uploads_.erase(left.back());
}

/// `left`: what is not used, once that has been asked for.
void MeshUploads::make_room(const MeshChunk& mesh, std::optional<std::vector<MeshId>>& left) {
  if (unused_ == Unused::stay || !pool_.shares_block(mesh)) return;
  while (!pool_.has_room(mesh)) {
    if (!left) left = unused();
    if (left->empty()) return;
    uploads_.erase(left->back());
    left->pop_back();
  }
}

}  // namespace isobrick
