#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "io/bytes/mapped_file.h"
#include "io/bytes/output_file.h"
#include "io/meshes/readers/mesh_parts_reader.h"

namespace isobrick::inline v0 {

/// Bytes in a nameless file of the folder for temporary files, to be mapped once they are all
/// there: what a mesh file holds only in text or packed.
class ScratchBytes {
 public:
  /// Throws Error where there is no such folder, or nothing can be written to it.
  ScratchBytes();
  void append(std::span<const std::byte> bytes) { out_.append(bytes); }
  std::uint64_t size() const { return out_.size(); }
  std::shared_ptr<MappedFile> map();

 private:
  FileWriter out_;
};

/// Rows of three numbers. They are doubles: a float would round the coordinates of a map before
/// the picture's origin is subtracted.
class ScratchRows {
 public:
  void add(Vec3d v) {
    bytes_.append(std::as_bytes(std::span(&v, 1)));
    ++count_;
  }
  std::uint64_t count() const { return count_; }
  /// The rows, whose file `keep` keeps.
  VertexField field(std::vector<std::shared_ptr<const void>>& keep, double scale = 1);

 private:
  ScratchBytes bytes_;
  std::uint64_t count_ = 0;
};

}  // namespace isobrick
