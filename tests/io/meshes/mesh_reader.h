#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "test_meshes.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {

// Small readers of what the sinks write, independent of them. Each expects what
// the format specifies and fails the test otherwise; none is meant for other files.

TestMesh read_ply(const std::string& bytes);
TestMesh read_obj(const std::string& text);
TestMesh read_vtp(const std::string& bytes);

/// A GLB with its parts joined one after the other; numbers are those of the whole.
struct GlbFile {
  std::string json;
  TestMesh mesh;          ///< in world units
  std::size_t parts = 0;  ///< primitives
  double step = 0;        ///< of the grid; 0: floats
};
/// `uri_folder`: where its external buffers lie.
GlbFile read_glb(const std::string& bytes, const std::string& uri_folder);

/// The file's parts joined, and how many there are.
struct PvtpFile {
  TestMesh mesh;
  std::vector<std::uint64_t> ids;  ///< global ids of all points
  std::size_t parts = 0;
};
PvtpFile read_pvtp(const std::string& text, const std::string& folder);

std::string read_bytes(const std::string& path);

}  // namespace isobrick
