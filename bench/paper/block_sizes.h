#pragma once

#include <vector>

namespace isobrick::inline v0::gpu {
struct LaunchShape;
}

namespace isobrick::bench {

/// The extraction kernel for u8 without normals with 32, 64, 128, 256, 512 and 1024 threads a
/// block, as figure 6 of the paper varies them; those that fit the current device.
std::vector<gpu::LaunchShape> block_sizes();

}  // namespace isobrick::bench
