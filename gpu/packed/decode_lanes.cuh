#pragma once

#include <cstdint>

// Four samples beside each other, as a thread of decode_bricks() has them.

namespace isobrick::inline v0::gpu {

/// Sums of four bytes, or of two halves, without carries between them.
__device__ inline std::uint32_t add_bytes(std::uint32_t a, std::uint32_t b) {
  return ((a & 0x7f7f7f7fu) + (b & 0x7f7f7f7fu)) ^ ((a ^ b) & 0x80808080u);
}
__device__ inline std::uint32_t add_halves(std::uint32_t a, std::uint32_t b) {
  return ((a & 0x7fff7fffu) + (b & 0x7fff7fffu)) ^ ((a ^ b) & 0x80008000u);
}

/// Four unsigned integers of `kBytes` bytes, in order along x.
template <int kBytes>
struct Quad;

template <>
struct Quad<1> {
  std::uint32_t v = 0;

  /// Of the bytes of a row, `bytes[k]` being byte k of the four codes.
  __device__ static Quad of_bytes(const std::uint32_t* bytes) { return {bytes[0]}; }
  __device__ static Quad of(std::uint32_t all, std::uint32_t) { return {all * 0x01010101u}; }
  __device__ Quad operator+(Quad b) const { return {add_bytes(v, b.v)}; }
  /// Differences of codes: magnitude and sign; 1 is what has no negative.
  __device__ Quad differences() const {
    const std::uint32_t magnitude = v >> 1 & 0x7f7f7f7fu, sign = v & 0x01010101u;
    const std::uint32_t lowest =
        (~(((v ^ 0x01010101u) & 0x7f7f7f7fu) + 0x7f7f7f7fu) & ~(v ^ 0x01010101u)) & 0x80808080u;
    return {add_bytes(magnitude ^ sign * 0xffu, sign) | lowest};
  }
  /// Sums from the first on.
  __device__ Quad sums() const {
    const Quad two = *this + Quad{v << 8};
    return two + Quad{two.v << 16};
  }
  /// The last one four times.
  __device__ Quad last() const { return {__byte_perm(v, 0, 0x3333)}; }
  __device__ Quad from_lane(int lane) const { return {__shfl_sync(~0u, v, lane)}; }
  __device__ Quad or_zero(bool keep) const { return {keep ? v : 0}; }
  __device__ void store(std::uint8_t* to) const { *reinterpret_cast<std::uint32_t*>(to) = v; }
  __device__ std::uint8_t at(int i) const { return static_cast<std::uint8_t>(v >> 8 * i); }
};

template <>
struct Quad<2> {
  std::uint32_t v[2] = {};

  __device__ static Quad of_bytes(const std::uint32_t* bytes) {
    return {{__byte_perm(bytes[0], bytes[1], 0x5140), __byte_perm(bytes[0], bytes[1], 0x7362)}};
  }
  __device__ static Quad of(std::uint32_t all, std::uint32_t) {
    return {{all * 0x00010001u, all * 0x00010001u}};
  }
  __device__ Quad operator+(Quad b) const {
    return {{add_halves(v[0], b.v[0]), add_halves(v[1], b.v[1])}};
  }
  __device__ Quad differences() const {
    Quad result;
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      const std::uint32_t magnitude = v[i] >> 1 & 0x7fff7fffu, sign = v[i] & 0x00010001u;
      const std::uint32_t other = v[i] ^ 0x00010001u;
      const std::uint32_t lowest = ~((other & 0x7fff7fffu) + 0x7fff7fffu) & ~other & 0x80008000u;
      result.v[i] = add_halves(magnitude ^ sign * 0xffffu, sign) | lowest;
    }
    return result;
  }
  __device__ Quad sums() const {
    const std::uint32_t low = add_halves(v[0], v[0] << 16), high = add_halves(v[1], v[1] << 16);
    return {{low, add_halves(high, __byte_perm(low, 0, 0x3232))}};
  }
  __device__ Quad last() const {
    const std::uint32_t all = __byte_perm(v[1], 0, 0x3232);
    return {{all, all}};
  }
  __device__ Quad from_lane(int lane) const {
    return {{__shfl_sync(~0u, v[0], lane), __shfl_sync(~0u, v[1], lane)}};
  }
  __device__ Quad or_zero(bool keep) const { return {{keep ? v[0] : 0, keep ? v[1] : 0}}; }
  __device__ void store(std::uint16_t* to) const {
    *reinterpret_cast<unsigned long long*>(to) = static_cast<unsigned long long>(v[1]) << 32 | v[0];
  }
  __device__ std::uint16_t at(int i) const {
    return static_cast<std::uint16_t>(v[i / 2] >> 16 * (i % 2));
  }
};

/// Quads whose integers are words of their own.
template <class U>
struct WordQuad {
  U v[4] = {};

  __device__ WordQuad operator+(WordQuad b) const {
    return {{v[0] + b.v[0], v[1] + b.v[1], v[2] + b.v[2], v[3] + b.v[3]}};
  }
  __device__ WordQuad differences() const {
    WordQuad result;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const U magnitude = v[i] >> 1, d = v[i] & 1 ? U{0} - magnitude : magnitude;
      result.v[i] = v[i] == 1 ? U{1} << (8 * sizeof(U) - 1) : d;
    }
    return result;
  }
  __device__ WordQuad sums() const {
    const U two = v[0] + v[1], three = two + v[2];
    return {{v[0], two, three, three + v[3]}};
  }
  __device__ WordQuad last() const { return {{v[3], v[3], v[3], v[3]}}; }
  __device__ WordQuad from_lane(int lane) const {
    return {{__shfl_sync(~0u, v[0], lane), __shfl_sync(~0u, v[1], lane),
             __shfl_sync(~0u, v[2], lane), __shfl_sync(~0u, v[3], lane)}};
  }
  __device__ WordQuad or_zero(bool keep) const {
    return {{keep ? v[0] : 0, keep ? v[1] : 0, keep ? v[2] : 0, keep ? v[3] : 0}};
  }
  __device__ void store(U* to) const {
    auto* const words = reinterpret_cast<uint4*>(to);
    if constexpr (sizeof(U) == 4) {
      words[0] = {v[0], v[1], v[2], v[3]};
    } else {
      words[0] = {low(v[0]), high(v[0]), low(v[1]), high(v[1])};
      words[1] = {low(v[2]), high(v[2]), low(v[3]), high(v[3])};
    }
  }
  __device__ static std::uint32_t low(U value) { return static_cast<std::uint32_t>(value); }
  __device__ static std::uint32_t high(U value) { return static_cast<std::uint32_t>(value >> 32); }
  __device__ U at(int i) const { return v[i]; }
};

/// Four words of their bytes.
__device__ inline void words_of_bytes(const std::uint32_t* bytes, std::uint32_t (&words)[4]) {
  const std::uint32_t a = __byte_perm(bytes[0], bytes[1], 0x5140),
                      b = __byte_perm(bytes[0], bytes[1], 0x7362),
                      c = __byte_perm(bytes[2], bytes[3], 0x5140),
                      d = __byte_perm(bytes[2], bytes[3], 0x7362);
  words[0] = __byte_perm(a, c, 0x5410);
  words[1] = __byte_perm(a, c, 0x7632);
  words[2] = __byte_perm(b, d, 0x5410);
  words[3] = __byte_perm(b, d, 0x7632);
}

template <>
struct Quad<4> : WordQuad<std::uint32_t> {
  __device__ Quad() {}
  __device__ Quad(WordQuad<std::uint32_t> q) : WordQuad<std::uint32_t>(q) {}
  __device__ static Quad of_bytes(const std::uint32_t* bytes) {
    Quad quad;
    words_of_bytes(bytes, quad.v);
    return quad;
  }
  __device__ static Quad of(std::uint32_t all, std::uint32_t) {
    return WordQuad<std::uint32_t>{{all, all, all, all}};
  }
};

template <>
struct Quad<8> : WordQuad<unsigned long long> {
  __device__ Quad() {}
  __device__ Quad(WordQuad<unsigned long long> q) : WordQuad<unsigned long long>(q) {}
  __device__ static Quad of_bytes(const std::uint32_t* bytes) {
    std::uint32_t low[4], high[4];
    words_of_bytes(bytes, low);
    words_of_bytes(bytes + 4, high);
    Quad quad;
#pragma unroll
    for (int i = 0; i < 4; ++i) quad.v[i] = static_cast<unsigned long long>(high[i]) << 32 | low[i];
    return quad;
  }
  __device__ static Quad of(std::uint32_t low, std::uint32_t high) {
    const unsigned long long all = static_cast<unsigned long long>(high) << 32 | low;
    return WordQuad<unsigned long long>{{all, all, all, all}};
  }
};

}  // namespace isobrick::gpu
