#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace isobrick::bench {

/// vtkFlyingEdges3D over a volume in memory, which it does not copy. VTK 9.1's
/// headers are not C++20, so this one stands unwelded as C++17.
class VtkPeer {
 public:
  /// `type` is the number of a ScalarType.
  VtkPeer(std::int64_t x, std::int64_t y, std::int64_t z, int type, void* samples);
  ~VtkPeer();

  struct Result {
    double seconds;
    std::uint64_t triangles, vertices;
  };
  Result run(double isovalue, bool normals, int threads);
  static std::string version();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::bench
