#include <utility>

#include "core/stopwatch.h"
#include "pipeline/extract/surface_extractor.h"
#include "surface/chunk_writer.h"
#include "surface/cpu_extractor.h"

namespace isobrick {
namespace {

class CpuSurface final : public SurfaceExtractor {
 public:
  CpuSurface(const ExtractRequest& request, const ExtractorLimits& limits,
             std::shared_ptr<TileWorkSpaces> spaces, MeshSink& sink)
      : extractor_(request.level->lattice, request.surface, limits, std::move(spaces)),
        writer_(sink) {}

  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
               const std::shared_ptr<const void>&) override {
    const Stopwatch watch(seconds_);
    extractor_.extract(tiles, bricks, mesh_, [&](MeshBuffer& mesh, std::uint64_t first) {
      bytes_ += mesh.positions.span().size_bytes() + mesh.normals.span().size_bytes() +
                mesh.triangles.span().size_bytes();
      writer_.write(mesh, first);
    });
  }

  void finish() override { writer_.finish(); }

  void report(ExtractReport& report) const override {
    report.backend = "cpu";
    report.triangles = extractor_.triangles();
    report.vertices = extractor_.vertices();
    report.degenerate_triangles = extractor_.degenerate_triangles();
    report.surface = {seconds_, bytes_};
    report.sink = {writer_.seconds(), bytes_};
  }

 private:
  CpuExtractor extractor_;
  ChunkWriter writer_;
  MeshBuffer mesh_;
  double seconds_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::unique_ptr<SurfaceExtractor> make_cpu_surface(const ExtractRequest& request,
                                                   const ExtractorLimits& limits,
                                                   std::shared_ptr<TileWorkSpaces> spaces,
                                                   MeshSink& sink) {
  return std::make_unique<CpuSurface>(request, limits, std::move(spaces), sink);
}

}  // namespace isobrick
