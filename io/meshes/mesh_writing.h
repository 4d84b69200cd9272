#pragma once

#include <span>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>

namespace isobrick::inline v0 {

/// Writes a mesh in memory to a sink, begin() and finish() included. Attributes have a value a
/// vertex, or the sink takes none.
void write_mesh(const Mesh& mesh, std::span<const VertexAttribute> attributes, MeshSink& sink,
                Progress& progress);

}  // namespace isobrick
