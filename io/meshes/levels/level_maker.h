#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/mesh_spool.h"
#include "io/meshes/levels/detail_sink.h"

namespace isobrick::inline v0 {

/// What DetailSink does, for vertices with numbers of a type.
class LevelMaker {
 public:
  virtual ~LevelMaker() = default;

  virtual void write(const MeshChunk& chunk) = 0;
  virtual void finish() = 0;
  virtual std::uint64_t bytes() const = 0;
  /// After finish().
  virtual std::vector<WrittenLevel> levels() const = 0;
};

/// Begins a mesh; `header` says of what type its numbers are. Encoding takes `work_bytes`.
std::unique_ptr<LevelMaker> make_levels(LevelWriter& writer, const LevelOptions& options,
                                        std::uint64_t work_bytes, const MeshHeader& header);

}  // namespace isobrick
