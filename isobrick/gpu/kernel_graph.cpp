#include "isobrick/gpu/kernel_graph.h"

#include "isobrick/gpu/cuda_check.h"

namespace isobrick::gpu {

KernelGraph::~KernelGraph() {
  if (executable_) (void)cudaGraphExecDestroy(executable_);
  if (graph_) (void)cudaGraphDestroy(graph_);
}

void KernelGraph::make(const cudaKernelNodeParams& kernel) {
  // As far as it was made by one that failed.
  if (!graph_) check(cudaGraphCreate(&graph_, 0));
  if (node_)
    check(cudaGraphKernelNodeSetParams(node_, &kernel));
  else
    check(cudaGraphAddKernelNode(&node_, graph_, nullptr, 0, &kernel));
  check(cudaGraphInstantiate(&executable_, graph_, 0));
}

void KernelGraph::launch(const char* name, const cudaKernelNodeParams& kernel,
                         cudaStream_t stream) {
  if (!executable_)
    make(kernel);
  else
    check(cudaGraphExecKernelNodeSetParams(executable_, node_, &kernel));
  (void)cudaGraphLaunch(executable_, stream);
  check_launch(name);
}

}  // namespace isobrick::gpu
