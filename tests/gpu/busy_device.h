#pragma once

#include <cuda_runtime_api.h>

namespace isobrick::testing {

/// Keeps most multiprocessors busy with a kernel on a stream of its own that ends when this goes,
/// or after some seconds, so that `left` of them are all that others get.
class BusyDevice {
 public:
  explicit BusyDevice(int left);
  ~BusyDevice();

  /// Whether it has given up.
  bool has_ended() const;

 private:
  cudaStream_t stream_ = nullptr;
  unsigned* words_ = nullptr;  ///< page-locked
};

}  // namespace isobrick::testing
