#pragma once

#include <cstdint>
#include <memory>

namespace isobrick::bench {

/// vtkContourFilter with one of VTK's own span-space searches, over a volume in
/// memory, which it does not copy. The volume is a vtkUniformGrid, because the
/// filter ignores its tree on a plain vtkImageData. C++17, as VTK 9.1's headers are.
class VtkTreePeer {
 public:
  enum class Tree { none, simple, span_space };

  /// `type` is the number of a ScalarType.
  VtkTreePeer(std::int64_t x, std::int64_t y, std::int64_t z, int type, void* samples, Tree tree);
  ~VtkTreePeer();

  /// Seconds to build the tree, and bytes of heap that it keeps.
  struct Built {
    double seconds = 0;
    std::uint64_t bytes = 0;
  };
  Built build();

  struct Result {
    double seconds;
    std::uint64_t triangles;
  };
  /// The contour at another isovalue than the one before; with the tree once it is built.
  Result run(double isovalue);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::bench
