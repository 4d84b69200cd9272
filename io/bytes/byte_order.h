#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace isobrick::inline v0 {

template <class Word>
void swap_words(std::byte* bytes, std::size_t count) {
  // Shifts and masks, no built-in swap: compilers turn this into vector code.
  for (std::size_t i = 0; i < count; ++i) {
    Word in, out = 0;
    std::memcpy(&in, bytes + i * sizeof(Word), sizeof(Word));
    for (std::size_t b = 0; b < sizeof(Word); ++b)
      out = static_cast<Word>(out | static_cast<Word>(static_cast<Word>(in >> (8 * b) & 0xff)
                                                      << (8 * (sizeof(Word) - 1 - b))));
    std::memcpy(bytes + i * sizeof(Word), &out, sizeof(Word));
  }
}

/// Reverses the bytes of each of `count` samples of `size` bytes, in place.
inline void swap_byte_order(std::byte* bytes, std::size_t count, std::size_t size) {
  if (size == 2) swap_words<std::uint16_t>(bytes, count);
  if (size == 4) swap_words<std::uint32_t>(bytes, count);
  if (size == 8) swap_words<std::uint64_t>(bytes, count);
}

}  // namespace isobrick
