#pragma once

#include <nvtx3/nvtx3.hpp>

namespace isobrick::inline v0::gpu {

struct NvtxDomain {
  static constexpr const char* name = "isobrick";
};

/// Shows a step of the host in Nsight Systems, from here to the end of the scope, with the kernels
/// and copies that it launches. Costs nanoseconds where no profiler is attached.
using NvtxRange = nvtx3::scoped_range_in<NvtxDomain>;

}  // namespace isobrick::gpu
