#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// What a file has of a mesh for people, beside its vertices and triangles.
struct MeshLabelling {
  std::string name = {};                    ///< empty: none
  std::optional<VertexColour> colour = {};  ///< of all of it, sRGB

  /// The name on one line.
  std::string line() const {
    std::string text = name;
    std::replace_if(
        text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    return text;
  }
  /// `chunk` with the colour at each vertex, unless it has colours of its own; `room` holds them.
  MeshChunk coloured(MeshChunk chunk, std::vector<VertexColour>& room) const {
    if (!colour || !chunk.colours.empty()) return chunk;
    room.assign(chunk.positions.size(), *colour);
    chunk.colours = room;
    return chunk;
  }
};

}  // namespace isobrick
