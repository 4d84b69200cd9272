#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// A level of detail that was written.
struct WrittenLevel {
  std::uint64_t triangles = 0;  ///< before they are cut at the faces of fragments
  std::uint64_t fragments = 0;  ///< that have triangles
  std::uint64_t bytes = 0;      ///< of the fragments
};

/// A sink that writes a mesh at several levels of detail.
class LevelSink : public MeshSink {
 public:
  /// After finish(): from the finest level to the coarsest.
  virtual std::vector<WrittenLevel> levels() const = 0;
};

}  // namespace isobrick
