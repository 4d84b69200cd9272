#include "isobrick/viewer/mesh_cache.h"

#include <algorithm>
#include <utility>

namespace isobrick {

MeshPtr MeshCache::find(const NodeKey& key, double isovalue, std::uint32_t coarser) {
  const auto found = nodes_.find(key);
  if (found == nodes_.end()) return nullptr;
  for (Entry& entry : found->second)
    if (entry.mesh->isovalue == isovalue && entry.mesh->coarser == coarser) {
      entry.used = now_;
      return entry.mesh;
    }
  return nullptr;
}

MeshPtr MeshCache::find_any(const NodeKey& key, double isovalue, std::uint32_t coarser) {
  if (MeshPtr exact = find(key, isovalue, coarser)) return exact;
  const auto found = nodes_.find(key);
  if (found == nodes_.end()) return nullptr;
  // The one made last met neighbours that are most like those of now.
  for (auto entry = found->second.rbegin(); entry != found->second.rend(); ++entry)
    if (entry->mesh->isovalue == isovalue) {
      entry->used = now_;
      return entry->mesh;
    }
  return nullptr;
}

bool MeshCache::has_any(const NodeKey& key, double isovalue) const {
  const auto found = nodes_.find(key);
  return found != nodes_.end() &&
         std::any_of(found->second.begin(), found->second.end(),
                     [&](const Entry& entry) { return entry.mesh->isovalue == isovalue; });
}

void MeshCache::put(MeshPtr mesh) {
  if (find(mesh->key, mesh->isovalue, mesh->coarser)) return;
  bytes_ += mesh->bytes();
  device_bytes_ += mesh->device_bytes;
  ++meshes_;
  nodes_[mesh->key].push_back({std::move(mesh), now_});
}

bool MeshCache::shrink() {
  const auto keeps_budgets = [&] { return bytes_ <= budget_ && device_bytes_ <= device_budget_; };
  if (keeps_budgets()) return true;
  // Not for each mesh that is made anew.
  drop_until(budget_ - budget_ / 8, device_budget_ - device_budget_ / 8);
  return keeps_budgets();
}

void MeshCache::shrink_device(std::uint64_t bytes) {
  drop_until(bytes_, device_bytes_ - std::min(bytes, device_bytes_));
}

/// Drops what was not used since begin_use(), the oldest first, down to this or as far as it goes.
void MeshCache::drop_until(std::uint64_t bytes, std::uint64_t device_bytes) {
  std::vector<std::pair<std::uint64_t, const NodeMesh*>> old;
  for (const auto& [key, entries] : nodes_)
    for (const Entry& entry : entries)
      if (entry.used < now_) old.emplace_back(entry.used, entry.mesh.get());
  std::sort(old.begin(), old.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, mesh] : old) {
    const bool here_too_many = bytes_ > bytes, there_too_many = device_bytes_ > device_bytes;
    if (!here_too_many && !there_too_many) break;
    if (!here_too_many && mesh->device_bytes == 0) continue;
    const auto found = nodes_.find(mesh->key);
    bytes_ -= mesh->bytes();
    device_bytes_ -= mesh->device_bytes;
    --meshes_;
    std::erase_if(found->second, [&](const Entry& entry) { return entry.mesh.get() == mesh; });
    if (found->second.empty()) nodes_.erase(found);
  }
}

}  // namespace isobrick
