#include "tests/gpu/kernels/decode_runner.h"

#include "tests/gpu/kernels/cuda_language.h"  // before what is written in it

#include "gpu/packed/check_ranges.cuh"
#include "gpu/packed/decode_bricks.cuh"

namespace isobrick::emulated {
namespace {

template <int kSampleBytes, bool kFloating>
void run(const gpu::DecodeParams& params, unsigned seed) {
  launch(params.parts * params.count, 32 * gpu::kDecodeWarps, 0, seed,
         [&] { gpu::decode_bricks<kSampleBytes, kFloating>(params); });
}

}  // namespace

void run_decode(ScalarType type, const gpu::DecodeParams& params, unsigned seed) {
  switch (size_of(type)) {
    case 1: return run<1, false>(params, seed);
    case 2: return run<2, false>(params, seed);
    case 4: return is_floating(type) ? run<4, true>(params, seed) : run<4, false>(params, seed);
    default: return run<8, true>(params, seed);
  }
}

void run_range_check(ScalarType type, const gpu::RangeCheckParams& params, unsigned seed) {
  visit_scalar(type, [&](auto tag) {
    launch(params.count * gpu::kChecksOfBrick, gpu::kCheckThreads, 0, seed,
           [&] { gpu::check_ranges<typename decltype(tag)::type>(params); });
  });
}

}  // namespace isobrick::emulated
