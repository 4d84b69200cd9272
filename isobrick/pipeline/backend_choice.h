#pragma once

#include <cstdint>

#include "isobrick/pipeline/extract_plan.h"

namespace isobrick {

/// Whether the GPU makes this surface. `active_blocks` is how much there is to do. Throws
/// for Backend::cuda where that cannot be: UsageError for what has no kernels, Error where
/// there is no device or no CUDA backend; and UsageError for a device that does not exist.
bool use_cuda(const ExtractRequest& request, const ExtractOptions& options,
              std::uint64_t active_blocks);

}  // namespace isobrick
