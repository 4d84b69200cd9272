#pragma once

#include <memory>
#include <span>

#include <isobrick/api.h>
#include <isobrick/mesh.h>

struct CUevent_st;   // cudaEvent_t points to one
struct CUstream_st;  // cudaStream_t points to one

namespace isobrick::inline v0 {

/// A welded mesh in the memory of a CUDA device. Copies share the memory, which goes with the last
/// of them, in the order of stream().
class ISOBRICK_API DeviceMesh {
 public:
  struct Impl;  ///< private to the library

  /// Empty.
  DeviceMesh();
  /// For the library itself.
  explicit DeviceMesh(std::shared_ptr<const Impl> impl);

  /// In world space; device memory, which the host cannot read.
  std::span<const Vec3f> positions() const;
  /// Unit length, outward; device memory; empty or one a position.
  std::span<const Vec3f> normals() const;
  /// Numbers of vertices; device memory.
  std::span<const Triangle> triangles() const;

  /// The number of the device; −1 when there is no mesh.
  int device() const;
  /// The stream that makes the mesh, a cudaStream_t.
  CUstream_st* stream() const;
  /// A cudaEvent_t that is over when the arrays are whole: work in other streams waits for it. Null
  /// when there is no mesh.
  CUevent_st* ready() const;

  /// Lets the work that follows in a stream of the same device wait until the arrays are whole. The
  /// host waits for nothing.
  void precede(CUstream_st* stream) const;
  /// A copy in host memory; waits until the arrays are whole.
  Mesh download() const;

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace isobrick
