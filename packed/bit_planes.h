#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "packed/packed_format.h"

// Bytes of codes and planes of their bits. Plain loops, which the compiler makes vectors of.

namespace isobrick::inline v0::packed {

/// Both groups of a slice side by side: rows 0 to 7, then 8 to 15.
inline constexpr int kPairBytes = 2 * kPlaneBytes;

/// One byte of the codes of a slice: eight planes, or the eight bytes of each column.
struct BytePlanes {
  alignas(kPairBytes) std::uint64_t words[kRows][kPairBytes / 8];

  std::uint8_t* row(int i) { return reinterpret_cast<std::uint8_t*>(words[i]); }
  const std::uint8_t* row(int i) const { return reinterpret_cast<const std::uint8_t*>(words[i]); }
};

/// Makes bit i of byte y bit y of byte i in all columns: planes become rows, and rows planes.
[[gnu::always_inline]] inline void transpose_bits(BytePlanes& planes) {
  constexpr std::uint64_t masks[] = {0x5555555555555555, 0x3333333333333333, 0x0f0f0f0f0f0f0f0f};
#pragma GCC unroll 3
  for (int stage = 0; stage < 3; ++stage) {
    const int step = 1 << stage;
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) {
      if (i & step) continue;
      std::uint64_t *const a = planes.words[i], *const b = planes.words[i + step];
#pragma GCC unroll 4
      for (int k = 0; k < kPairBytes / 8; ++k) {
        const std::uint64_t swapped = ((a[k] >> step) ^ b[k]) & masks[stage];
        b[k] ^= swapped;
        a[k] ^= swapped << step;
      }
    }
  }
}

/// A difference as magnitude and sign, the sign lowest: small differences have high bits 0, and
/// multiples of a power of two low bits. What has no negative is the code 1.
template <class U>
[[gnu::always_inline]] constexpr U code_of(U difference) {
  const U negative =
      static_cast<std::make_signed_t<U>>(difference) < 0 ? static_cast<U>(~U{0}) : U{0};
  const U magnitude = static_cast<U>(static_cast<U>(difference ^ negative) - negative);
  return static_cast<U>(static_cast<U>(magnitude + magnitude) - negative);
}

/// The difference of a code.
template <class U>
[[gnu::always_inline]] constexpr U difference_of(U code) {
  constexpr U kLowest = static_cast<U>(U{1} << (8 * sizeof(U) - 1));
  const U sign = static_cast<U>(code & 1);
  const U magnitude = static_cast<U>(code >> 1);
  const U difference = static_cast<U>((magnitude ^ static_cast<U>(U{0} - sign)) + sign);
  return static_cast<U>(difference | (code == 1 ? kLowest : U{0}));
}

/// The bits of a floating-point number as an integer that is ordered as numbers are.
template <class U>
[[gnu::always_inline]] constexpr U ordered_of(U bits) {
  constexpr int kTop = 8 * sizeof(U) - 1;
  const U negative = static_cast<U>(U{0} - static_cast<U>(bits >> kTop));
  return static_cast<U>(bits ^ static_cast<U>(negative | static_cast<U>(U{1} << kTop)));
}
template <class U>
[[gnu::always_inline]] constexpr U bits_of_ordered(U ordered) {
  constexpr int kTop = 8 * sizeof(U) - 1;
  const U positive = static_cast<U>(U{0} - static_cast<U>(ordered >> kTop));
  return static_cast<U>(ordered ^
                        static_cast<U>(static_cast<U>(~positive) | static_cast<U>(U{1} << kTop)));
}

}  // namespace isobrick::inline v0::packed
