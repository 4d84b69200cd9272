#pragma once

#include <memory>
#include <span>

#include <isobrick/mesh.h>
#include "core/tile.h"
#include "pipeline/extract/extract_plan.h"

namespace isobrick {

/// Makes the surface of tiles and hands it to a sink, on whatever backend. Everywhere the
/// mesh is the same.
class SurfaceExtractor {
 public:
  virtual ~SurfaceExtractor() = default;

  /// Over all calls, tiles come in Morton order, none twice; `bricks` holds those of
  /// for_each_needed_box. It is not looked up any more afterwards, but its samples may be
  /// read until `samples`, which owns them, is let go. Called in the TBB arena that does the
  /// work.
  virtual void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
                       const std::shared_ptr<const void>& samples) = 0;
  /// Waits until the sink has taken all of the mesh.
  virtual void finish() = 0;
  /// Adds counts and stages; after finish().
  virtual void report(ExtractReport& report) const = 0;
};

/// The CPU. The sink must outlive it. For TileWorkSpaces see CpuExtractor.
std::unique_ptr<SurfaceExtractor> make_cpu_surface(const ExtractRequest& request,
                                                   const ExtractorLimits& limits,
                                                   std::shared_ptr<TileWorkSpaces> spaces,
                                                   MeshSink& sink);

}  // namespace isobrick
