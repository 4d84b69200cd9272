#pragma once

#include <cuda_runtime_api.h>

namespace isobrick::gpu {

/// Launches one kernel after the other as a graph of one node, which the driver does in less
/// time than a launch by itself. Not thread-safe.
class KernelGraph {
 public:
  KernelGraph() = default;
  KernelGraph(const KernelGraph&) = delete;
  KernelGraph& operator=(const KernelGraph&) = delete;
  ~KernelGraph();

  /// Launches the kernel on `stream`; its arguments are copied. `name` is for errors.
  void launch(const char* name, const cudaKernelNodeParams& kernel, cudaStream_t stream);

 private:
  void make(const cudaKernelNodeParams& kernel);

  cudaGraph_t graph_ = nullptr;
  cudaGraphNode_t node_ = nullptr;
  cudaGraphExec_t executable_ = nullptr;
};

}  // namespace isobrick::gpu
