#pragma once

#include <string>

#include "io/meshes/levels/fragment_mesh.h"

namespace isobrick::inline v0 {

/// Throws UsageError where this isobrick was built without Draco.
void check_draco();

/// A mesh as Draco stores it, with whole numbers for positions; empty for one without triangles.
/// Thread-safe. Throws as check_draco() does, and Error where Draco fails.
std::string encode_draco(const FragmentMesh& mesh);

}  // namespace isobrick
