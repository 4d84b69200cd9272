#include <cstdlib>

#include "gpu/resident/pack_params.h"

namespace isobrick::inline v0::gpu {

PackOrder pack_order(const PackParams& params, std::size_t sample_bytes) {
  constexpr std::size_t vector = 16;
  const std::int64_t x = std::abs(params.strides[0]), y = std::abs(params.strides[1]),
                     z = std::abs(params.strides[2]);
  if (y < x && y <= z) return PackOrder::along_y;
  if (z < x) return PackOrder::along_z;
  const auto is_aligned = [&](std::int64_t samples) {
    return static_cast<std::size_t>(samples) * sample_bytes % vector == 0;
  };
  return params.strides[0] == 1 && is_aligned(y) && is_aligned(z) &&
                 reinterpret_cast<std::uintptr_t>(params.samples) % vector == 0
             ? PackOrder::vectors
             : PackOrder::along_x;
}

}  // namespace isobrick::gpu
