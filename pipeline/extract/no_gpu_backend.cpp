#include <isobrick/error.h>
#include "pipeline/extract/gpu_backend.h"

namespace isobrick {

bool built_with_cuda() { return false; }
int cuda_device_count() { return 0; }

std::unique_ptr<GpuSession> open_gpu(int) {
  throw Error("this isobrick was built without CUDA; use --backend cpu");
}

}  // namespace isobrick
