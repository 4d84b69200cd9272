#include "gpu/packed/decode_kernel.h"

#include "gpu/memory/cuda_check.h"
#include "gpu/packed/check_ranges.cuh"
#include "gpu/packed/decode_bricks.cuh"

namespace isobrick::inline v0::gpu {
namespace {

template <int kSampleBytes, bool kFloating>
void launch(const DecodeParams& p, cudaStream_t stream) {
  decode_bricks<kSampleBytes, kFloating><<<p.parts * p.count, 32 * kDecodeWarps, 0, stream>>>(p);
}

}  // namespace

void launch_decode(ScalarType type, const DecodeParams& params, cudaStream_t stream) {
  if (params.count == 0) return;
  switch (size_of(type)) {
    case 1: launch<1, false>(params, stream); break;
    case 2: launch<2, false>(params, stream); break;
    case 4:
      if (is_floating(type))
        launch<4, true>(params, stream);
      else
        launch<4, false>(params, stream);
      break;
    default: launch<8, true>(params, stream);
  }
  check_launch("decode_bricks");
}

void launch_range_check(ScalarType type, const RangeCheckParams& params, cudaStream_t stream) {
  if (params.count == 0) return;
  visit_scalar(type, [&](auto tag) {
    check_ranges<typename decltype(tag)::type>
        <<<params.count * kChecksOfBrick, kCheckThreads, 0, stream>>>(params);
  });
  check_launch("check_ranges");
}

}  // namespace isobrick::gpu
