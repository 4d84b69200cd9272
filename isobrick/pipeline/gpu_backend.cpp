#include "isobrick/pipeline/gpu_backend.h"

#include <algorithm>
#include <utility>

#include "isobrick/gpu/device.h"
#include "isobrick/gpu/gpu_extractor.h"
#include "isobrick/gpu/host_memory.h"
#include "isobrick/pipeline/chunk_writer.h"

namespace isobrick {
namespace {

class CudaSurface final : public SurfaceExtractor {
 public:
  CudaSurface(int device, const gpu::DeviceInfo& info, const ExtractRequest& request,
              const gpu::StreamSizes& sizes, MeshSink& sink)
      : info_(info),
        writer_(sink),
        extractor_(device, request.level->lattice, request.surface, sizes,
                   [this](const MeshChunk& chunk, std::function<void()> release) {
                     writer_.write(chunk, std::move(release));
                   }) {
    const std::uint64_t free = gpu::open_device(device).free_bytes;
    bytes_in_use_ = info_.free_bytes - std::min(free, info_.free_bytes);
  }

  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
               const std::shared_ptr<const void>& samples) override {
    extractor_.extract(tiles, bricks, samples);
  }

  void finish() override {
    extractor_.finish();
    writer_.finish();
  }

  void report(ExtractReport& report) const override {
    const gpu::StreamReport r = extractor_.report();
    const auto stage = [](const gpu::StreamStage& s) { return StageReport{s.seconds, s.bytes}; };
    report.backend = "cuda";
    report.device = info_.name;
    report.vertices = r.vertices;
    report.triangles = r.triangles;
    report.gather = stage(r.gather);
    report.upload = stage(r.upload);
    report.kernel = stage(r.kernel);
    report.download = stage(r.download);
    report.sink = {writer_.seconds(), r.download.bytes};
    report.device_bytes = r.device_bytes;
    report.device_bytes_in_use = bytes_in_use_;
    report.pinned_bytes = r.pinned_bytes;
    report.launches = r.launches + r.repeats;
  }

 private:
  gpu::DeviceInfo info_;
  std::uint64_t bytes_in_use_ = 0;
  ChunkWriter writer_;
  gpu::GpuExtractor extractor_;  // ends first: its thread hands chunks to the writer
};

class CudaSession final : public GpuSession {
 public:
  explicit CudaSession(int device) : device_(device), info_(gpu::open_device(device)) {}

  std::uint64_t plan(const ExtractRequest& request, std::uint64_t device_budget,
                     std::uint64_t host_budget, std::uint64_t other_host_bytes) override {
    if (device_budget == 0) device_budget = info_.free_bytes - info_.free_bytes / 10;
    sizes_ = gpu::fit_stream_sizes(request.level->lattice, request.surface, device_budget,
                                   host_budget, other_host_bytes);
    return sizes_.pinned_bytes + sizes_.host_bytes;
  }

  std::size_t good_batch() const override { return sizes_.tiles; }

  std::shared_ptr<std::byte> brick_memory(std::size_t bytes) const override {
    return gpu::host_memory(device_, bytes);
  }

  std::unique_ptr<SurfaceExtractor> make_surface(const ExtractRequest& request,
                                                 MeshSink& sink) override {
    return std::make_unique<CudaSurface>(device_, info_, request, sizes_, sink);
  }

 private:
  int device_;
  gpu::DeviceInfo info_;
  gpu::StreamSizes sizes_;
};

}  // namespace

bool built_with_cuda() { return true; }
int cuda_device_count() { return gpu::device_count(); }

std::unique_ptr<GpuSession> open_gpu(int device) { return std::make_unique<CudaSession>(device); }

}  // namespace isobrick
