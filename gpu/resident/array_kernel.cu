#include "gpu/resident/array_kernel.h"

#include <algorithm>

#include "gpu/memory/cuda_check.h"
#include "gpu/resident/array_blocks.cuh"
#include "gpu/resident/array_ranges.cuh"

namespace isobrick::inline v0::gpu {
namespace {

/// Thread blocks that share the tiles of a launch; the host does not know how many there are.
constexpr unsigned kSharedLaunch = 2048;

/// Calls f(TypeTag<T>, order) with the order as a type.
template <class F>
void visit_order(ScalarType type, const ArrayParams& array, F&& f) {
  visit_scalar(type, [&](auto tag) {
    using enum ArrayOrder;
    switch (array_order(array, sizeof(typename decltype(tag)::type))) {
      case vectors: return f(tag, std::integral_constant<ArrayOrder, vectors>());
      case along_x: return f(tag, std::integral_constant<ArrayOrder, along_x>());
      case along_y: return f(tag, std::integral_constant<ArrayOrder, along_y>());
      case along_z: return f(tag, std::integral_constant<ArrayOrder, along_z>());
    }
  });
}

}  // namespace

void launch_part_ranges(ScalarType type, const ArrayRangeParams& p, cudaStream_t stream) {
  visit_order(type, p.array, [&](auto tag, auto order) {
    find_part_ranges<typename decltype(tag)::type, decltype(order)::value>
        <<<p.count, kArrayThreads, 0, stream>>>(p);
  });
  check_launch("find_part_ranges");
}

void launch_join_ranges(ScalarType type, const ArrayRangeParams& p, cudaStream_t stream) {
  const unsigned blocks = (p.count + kArrayThreads - 1) / kArrayThreads;
  visit_scalar(type, [&](auto tag) {
    join_part_ranges<typename decltype(tag)::type><<<blocks, kArrayThreads, 0, stream>>>(p);
  });
  check_launch("join_part_ranges");
}

void launch_load(ScalarType type, const ArrayLoadParams& p, cudaStream_t stream) {
  claim_blocks<<<kSharedLaunch / 8, kArrayThreads, 0, stream>>>(p);
  check_launch("claim_blocks");
  visit_order(type, p.array, [&](auto tag, auto order) {
    copy_tiles<typename decltype(tag)::type, decltype(order)::value>
        <<<std::max(1u, std::min(p.room, kSharedLaunch)), kArrayThreads, 0, stream>>>(p);
  });
  check_launch("copy_tiles");
}

}  // namespace isobrick::gpu
