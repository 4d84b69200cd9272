#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <isobrick/surface_options.h>
#include "viewer/scene/node_grid.h"

namespace isobrick::inline v0 {

/// Identifies a node's mesh: meshes with one id have the same bytes.
struct MeshId {
  NodeKey key;
  double isovalue = 0;
  std::uint32_t coarser = 0;
  friend bool operator==(const MeshId&, const MeshId&) = default;
};

struct MeshIdHash {
  std::size_t operator()(const MeshId& id) const {
    return NodeKeyHash()(id.key) ^ std::hash<double>()(id.isovalue) ^
           std::size_t{id.coarser} * 0x9e3779b97f4a7c15ULL;
  }
};

class DeviceMesh;

/// The surface in one node. Immutable once made.
struct NodeMesh {
  NodeKey key;
  double isovalue = 0;
  std::uint32_t coarser = 0;  ///< mask of neighbours one level above whose border it matches
  /// Positions in world space minus the scene's origin; unit normals towards the outside. Triangles
  /// index the mesh's own vertices, counter-clockwise seen from outside.
  Mesh mesh;
  /// The same in device memory; then `mesh` is empty. See device_mesher.h.
  std::shared_ptr<const DeviceMesh> device;
  std::uint64_t device_triangles = 0, device_bytes = 0;  ///< of the mesh on the device
  /// The last `seam_triangles` triangles are seam strips along the borders to coarser neighbours.
  /// They lie across the surface, a small part of a cell wide, and are visible from both sides.
  std::uint32_t seam_triangles = 0;
  /// Message about damaged samples; the mesh is empty then. Empty if all is well.
  std::string damage;

  MeshId id() const { return {key, isovalue, coarser}; }
  std::uint64_t triangles() const { return mesh.triangles.size() + device_triangles; }
  bool empty() const { return triangles() == 0; }
  /// Bytes of host memory.
  std::uint64_t bytes() const {
    return sizeof(NodeMesh) + mesh.positions.capacity() * sizeof(Vec3f) +
           mesh.normals.capacity() * sizeof(Vec3f) + mesh.triangles.capacity() * sizeof(Triangle);
  }
};

}  // namespace isobrick
