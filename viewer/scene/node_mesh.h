#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <isobrick/surface_options.h>
#include "viewer/scene/node_grid.h"

namespace isobrick {

/// What a node's mesh is a function of: two meshes with one id are the same.
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

/// The surface in one node. Immutable once it is made.
struct NodeMesh {
  NodeKey key;
  double isovalue = 0;
  std::uint32_t coarser = 0;  ///< directions of the neighbours one level above that it meets
  /// Positions in world space minus the scene's origin; unit normals towards the
  /// outside; triangles number the mesh's own vertices, counter-clockwise from there.
  MeshBuffer mesh;
  /// The same on a device, instead; see device_mesher.h.
  std::shared_ptr<const DeviceMesh> device;
  std::uint64_t device_triangles = 0, device_bytes = 0;  ///< of that
  /// How many of the triangles, the last ones, are the seam strips along the borders to coarser
  /// neighbours: a small part of a cell wide, across the surface, seen from both sides.
  std::uint32_t seam_triangles = 0;
  /// What is wrong with the samples; empty when all is well. The mesh is empty otherwise.
  std::string damage;

  MeshId id() const { return {key, isovalue, coarser}; }
  std::uint64_t triangles() const { return mesh.triangles.size() + device_triangles; }
  bool empty() const { return triangles() == 0; }
  /// Of host memory.
  std::uint64_t bytes() const {
    return sizeof(NodeMesh) + mesh.positions.capacity() * sizeof(Vec3f) +
           mesh.normals.capacity() * sizeof(Vec3f) + mesh.triangles.capacity() * sizeof(Triangle);
  }
};

}  // namespace isobrick
