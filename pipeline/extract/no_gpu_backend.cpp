#include <isobrick/error.h>
#include "pipeline/extract/gpu_backend.h"
#include "pipeline/extract/resident_pass.h"

namespace isobrick::inline v0 {
namespace {

[[noreturn]] void refuse() {
  throw Error("this isobrick was built without CUDA; use --backend cpu");
}

}  // namespace

bool built_with_cuda() { return false; }
int cuda_device_count() { return 0; }

std::unique_ptr<GpuSession> open_gpu(int) { refuse(); }

ResidentPassResult run_resident_pass(const StoreReader&, const ExtractOptions&, const PassSurfaces&,
                                     TileStream, std::uint64_t,
                                     const std::function<void(std::size_t)>&, Progress&) {
  refuse();
}

}  // namespace isobrick
