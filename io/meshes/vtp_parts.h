#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"
#include "io/bytes/parted_output.h"
#include "io/meshes/mesh_parts.h"

// The files of a VTK partitioned PolyData (.pvtp): the parts, each a .vtp, and the index that names
// them.

namespace isobrick::inline v0 {

inline constexpr std::string_view kVtpExtension = ".vtp";

/// Throws UsageError for a name that XML cannot hold, not UTF-8 or with control characters, and for
/// standard output.
void check_pvtp_name(const std::string& path);

/// Writes a part, whose points carry their numbers in the whole mesh as global ids.
void write_vtp_part(FileWriter& out, const StoredMesh& mesh, const MeshHeader& header,
                    const MeshPart& part);

/// The index, of as many parts in each run of the mesh.
std::string pvtp_index(const MeshHeader& header, const PartedOutput& output,
                       std::span<const std::uint32_t> parts);

}  // namespace isobrick
