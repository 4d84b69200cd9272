#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/vtk/vtk_arrays.h"
#include "io/vtk/vtk_file.h"

namespace isobrick::inline v0 {

/// Numbers side by side in mapped memory.
struct NumberArray {
  const std::byte* first = nullptr;
  std::uint64_t count = 0;
  NumberKind kind{};
  bool swapped = false;

  double at(std::uint64_t i) const { return load_number(first + i * size_of(kind), kind, swapped); }
};

/// The arrays of a VTK file. Plain numbers stay in the file; text, base64 and zlib are decoded into
/// files without names.
class VtpArrays {
 public:
  /// `bytes` are those of `file`. All must outlive it; `keep` gets the files without names.
  VtpArrays(const VtkFile& file, std::span<const std::byte> bytes, const VtkHeader& header,
            std::vector<std::shared_ptr<const void>>& keep)
      : file_(file), bytes_(bytes), header_(header), keep_(keep) {}

  /// Throws Error for an array that is damaged or of a kind that is not read.
  NumberArray numbers(const VtkElement& array) const;
  /// An array of characters up to the first zero, `max` at most.
  std::string text(const VtkElement& array, std::size_t max) const;

 private:
  const VtkFile& file_;
  std::span<const std::byte> bytes_;
  const VtkHeader& header_;
  std::vector<std::shared_ptr<const void>>& keep_;
};

}  // namespace isobrick
