#pragma once

#include <cuda_runtime_api.h>

namespace isobrick::testing {

/// Keeps most multiprocessors busy with a kernel on a stream of its own that ends when this goes,
/// so that `left` of them are all that others get.
class BusyDevice {
 public:
  explicit BusyDevice(int left);
  ~BusyDevice();

 private:
  cudaStream_t stream_ = nullptr;
  unsigned* words_ = nullptr;  ///< page-locked: multiprocessors taken, whether it ends
};

}  // namespace isobrick::testing
