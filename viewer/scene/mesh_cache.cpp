#include "viewer/scene/mesh_cache.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace isobrick::inline v0 {

std::vector<MeshCache::Entry>* MeshCache::entries_of(const NodeKey& key, double isovalue) {
  const auto surface = surfaces_.find(isovalue);
  if (surface == surfaces_.end()) return nullptr;
  const auto found = surface->second.nodes.find(key);
  return found == surface->second.nodes.end() ? nullptr : &found->second;
}

MeshPtr MeshCache::find(const NodeKey& key, double isovalue, std::uint32_t coarser) {
  std::vector<Entry>* const entries = entries_of(key, isovalue);
  if (entries == nullptr) return nullptr;
  for (Entry& entry : *entries)
    if (entry.coarser == coarser) {
      entry.used = use_;
      return entry.mesh;
    }
  return nullptr;
}

MeshPtr MeshCache::find_any(const NodeKey& key, double isovalue, std::uint32_t coarser) {
  std::vector<Entry>* const entries = entries_of(key, isovalue);
  if (entries == nullptr) return nullptr;
  const auto exact = std::find_if(entries->begin(), entries->end(),
                                  [&](const Entry& entry) { return entry.coarser == coarser; });
  // The neighbours of the newest mesh are most like the present ones.
  Entry& entry = exact != entries->end() ? *exact : entries->back();
  entry.used = use_;
  return entry.mesh;
}

bool MeshCache::has_any(const NodeKey& key, double isovalue) const {
  const auto surface = surfaces_.find(isovalue);
  return surface != surfaces_.end() && surface->second.nodes.contains(key);
}

int MeshCache::finest_level(double isovalue) const {
  const auto surface = surfaces_.find(isovalue);
  return surface == surfaces_.end() ? std::numeric_limits<int>::max()
                                    : surface->second.levels.begin()->first;
}

void MeshCache::put(MeshPtr mesh) {
  if (find(mesh->key, mesh->isovalue, mesh->coarser)) return;
  bytes_ += mesh->bytes();
  device_bytes_ += mesh->device_bytes;
  ++meshes_;
  Surface& surface = surfaces_[mesh->isovalue];
  std::vector<Entry>& entries = surface.nodes[mesh->key];
  if (entries.empty()) ++surface.levels[mesh->key.level];
  entries.push_back({mesh->coarser, use_, std::move(mesh)});
}

bool MeshCache::shrink() {
  if (is_within_budgets()) return true;
  // Leaves some room, so that not every new mesh causes another search.
  drop_until(budget_ - budget_ / 8, device_budget_ - device_budget_ / 8);
  return is_within_budgets();
}

void MeshCache::shrink_device(std::uint64_t bytes) {
  drop_until(bytes_, device_bytes_ - std::min(bytes, device_bytes_));
}

/// Drops unused meshes, the oldest first, until both limits hold or none is left.
void MeshCache::drop_until(std::uint64_t bytes, std::uint64_t device_bytes) {
  std::vector<std::pair<std::uint64_t, const NodeMesh*>> old;
  for (const auto& [isovalue, surface] : surfaces_)
    for (const auto& [key, entries] : surface.nodes)
      for (const Entry& entry : entries)
        if (entry.used < use_) old.emplace_back(entry.used, entry.mesh.get());
  std::sort(old.begin(), old.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, mesh] : old) {
    const bool too_many_on_host = bytes_ > bytes, too_many_on_device = device_bytes_ > device_bytes;
    if (!too_many_on_host && !too_many_on_device) break;
    if (too_many_on_host || mesh->device_bytes > 0) drop(*mesh);
  }
}

void MeshCache::drop(const NodeMesh& mesh) {
  const auto surface = surfaces_.find(mesh.isovalue);
  auto& [nodes, levels] = surface->second;
  const auto node = nodes.find(mesh.key);
  const auto level = levels.find(mesh.key.level);
  bytes_ -= mesh.bytes();
  device_bytes_ -= mesh.device_bytes;
  --meshes_;
  std::erase_if(node->second, [&](const Entry& entry) { return entry.mesh.get() == &mesh; });
  if (!node->second.empty()) return;
  nodes.erase(node);
  if (--level->second == 0) levels.erase(level);
  if (nodes.empty()) surfaces_.erase(surface);
}

}  // namespace isobrick
