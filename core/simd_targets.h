#pragma once

#include <hwy/base.h>
#include <hwy/targets.h>

#if HWY_ARCH_X86
#include <cpuid.h>
#endif

#include <algorithm>
#include <atomic>

// Functions that Highway compiled for several processors, and the choice among them. Its own
// dispatch would do the same, but it links libhwy, which times its clock for 5 ms whenever a
// program starts.

namespace isobrick::inline v0 {

/// What this processor has of what functions are compiled for, from the least to the most.
enum class SimdLevel { baseline, sse4, avx2, avx3, avx3_dl };

#if HWY_ARCH_X86
/// Features that Clang's __builtin_cpu_supports() does not know.
struct MoreFeatures {
  bool f16c = false, vaes = false;
};
inline MoreFeatures more_features() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  MoreFeatures more;
  if (__get_cpuid(1, &a, &b, &c, &d)) more.f16c = (c >> 29 & 1) != 0;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d)) more.vaes = (c >> 9 & 1) != 0;
  return more;
}
#endif

inline SimdLevel find_simd_level() {
#if HWY_ARCH_X86
  __builtin_cpu_init();
  const bool sse4 = __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("sse4.2") &&
                    __builtin_cpu_supports("aes") && __builtin_cpu_supports("pclmul");
  if (!sse4) return SimdLevel::baseline;
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                    __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
                    more_features().f16c;
  if (!avx2) return SimdLevel::sse4;
  const bool avx3 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                    __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512cd");
  if (!avx3) return SimdLevel::avx2;
  const bool avx3_dl =
      __builtin_cpu_supports("avx512vnni") && __builtin_cpu_supports("vpclmulqdq") &&
      more_features().vaes && __builtin_cpu_supports("avx512vbmi") &&
      __builtin_cpu_supports("avx512vbmi2") && __builtin_cpu_supports("avx512bitalg") &&
      __builtin_cpu_supports("avx512vpopcntdq");
  return avx3_dl ? SimdLevel::avx3_dl : SimdLevel::avx3;
#else
  return SimdLevel::baseline;
#endif
}

/// For tests: the functions of higher levels are not taken. No meaning of it is public.
inline std::atomic<SimdLevel> max_simd_level = SimdLevel::avx3_dl;

/// The level of this processor, or max_simd_level.
inline SimdLevel simd_level() {
  static const SimdLevel found = find_simd_level();
  return std::min(found, max_simd_level.load(std::memory_order_relaxed));
}

/// The one that this processor runs best, of functions for each level; null where one was not
/// compiled. The baseline is all that the compiler's options allow.
template <class F>
F best_of(F baseline, F sse4, F avx2, F avx3, F avx3_dl) {
  const SimdLevel level = simd_level();
  if (avx3_dl && level >= SimdLevel::avx3_dl) return avx3_dl;
  if (avx3 && level >= SimdLevel::avx3) return avx3;
  if (avx2 && level >= SimdLevel::avx2) return avx2;
  if (sse4 && level >= SimdLevel::sse4) return sse4;
  return baseline;
}

/// best_of() for a function in HWY_NAMESPACE.
#define ISOBRICK_BEST_OF(FUNCTION)                                                          \
  ::isobrick::best_of<decltype(&HWY_STATIC_DISPATCH(FUNCTION))>(                            \
      &HWY_STATIC_DISPATCH(FUNCTION), HWY_CHOOSE_SSE4(FUNCTION), HWY_CHOOSE_AVX2(FUNCTION), \
      HWY_CHOOSE_AVX3(FUNCTION), HWY_CHOOSE_AVX3_DL(FUNCTION))

}  // namespace isobrick
