#include "packed/packed_blocks.h"

// Highway compiles what lies in HWY_NAMESPACE once for every target below.
#define HWY_DISABLED_TARGETS \
  (HWY_SSSE3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "packed/packed_blocks.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
//
#include <hwy/highway.h>

#include <bit>
#include <cstring>

#include "core/simd_targets.h"
#include "packed/block_decoder-inl.h"
#include "packed/block_encoder-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0::packed {
namespace HWY_NAMESPACE {

std::size_t pack_any(BlockKind kind, const void* samples, std::uint8_t* out) {
  switch (kind.code_bytes) {
    case 1: return pack<std::uint8_t>(static_cast<const std::uint8_t*>(samples), false, out);
    case 2: return pack<std::uint16_t>(static_cast<const std::uint16_t*>(samples), false, out);
    case 4:
      return pack<std::uint32_t>(static_cast<const std::uint32_t*>(samples), kind.floating, out);
    default:
      return pack<std::uint64_t>(static_cast<const std::uint64_t*>(samples), kind.floating, out);
  }
}

template <class U>
bool unpack_of(bool floating, std::span<const std::uint8_t> block, void* samples,
               std::ptrdiff_t row, std::ptrdiff_t slice) {
  BlockDecoder<U> decoder(block);
  return decoder.decode({static_cast<U*>(samples), row, slice}, floating);
}

bool unpack_any(BlockKind kind, std::span<const std::uint8_t> block, void* samples,
                std::ptrdiff_t row, std::ptrdiff_t slice) {
  switch (kind.code_bytes) {
    case 1: return unpack_of<std::uint8_t>(false, block, samples, row, slice);
    case 2: return unpack_of<std::uint16_t>(false, block, samples, row, slice);
    case 4: return unpack_of<std::uint32_t>(kind.floating, block, samples, row, slice);
    default: return unpack_of<std::uint64_t>(kind.floating, block, samples, row, slice);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick::inline v0::packed
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isobrick::inline v0::packed {

std::size_t pack_block(BlockKind kind, const void* samples, std::uint8_t* out) {
  const auto best = ISOBRICK_BEST_OF(pack_any);
  return best(kind, samples, out);
}

bool unpack_block(BlockKind kind, std::span<const std::uint8_t> block, void* samples,
                  std::ptrdiff_t row, std::ptrdiff_t slice) {
  const auto best = ISOBRICK_BEST_OF(unpack_any);
  return best(kind, block, samples, row, slice);
}

}  // namespace isobrick::inline v0::packed
#endif  // HWY_ONCE
