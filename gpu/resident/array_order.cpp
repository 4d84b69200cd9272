#include <cstdlib>

#include "gpu/resident/array_params.h"

namespace isobrick::inline v0::gpu {

ArrayOrder array_order(const ArrayParams& array, std::size_t sample_bytes) {
  constexpr std::size_t vector = 16;
  const std::int64_t x = std::abs(array.strides[0]), y = std::abs(array.strides[1]),
                     z = std::abs(array.strides[2]);
  if (y < x && y <= z) return ArrayOrder::along_y;
  if (z < x) return ArrayOrder::along_z;
  const auto is_aligned = [&](std::int64_t samples) {
    return static_cast<std::size_t>(samples) * sample_bytes % vector == 0;
  };
  return array.strides[0] == 1 && is_aligned(y) && is_aligned(z) &&
                 reinterpret_cast<std::uintptr_t>(array.samples) % vector == 0
             ? ArrayOrder::vectors
             : ArrayOrder::along_x;
}

}  // namespace isobrick::gpu
