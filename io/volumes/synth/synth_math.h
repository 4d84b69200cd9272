#pragma once

#include <cmath>
#include <cstdint>

namespace isobrick::inline v0 {

// Exact operations only (IEEE + − × ÷ √, floor, integers): the C library's sine
// differs from machine to machine. The build forbids contraction into fma.

/// sin(2π·turns), to 1e-11.
inline double sin_turns(double turns) {
  double t = turns - std::floor(turns + 0.5);
  if (t > 0.25) t = 0.5 - t;
  if (t < -0.25) t = -0.5 - t;
  const double x = t * 6.283185307179586;
  const double q = x * x;
  double s = -1.0 / 1307674368000.0;
  s = s * q + 1.0 / 6227020800.0;
  s = s * q - 1.0 / 39916800.0;
  s = s * q + 1.0 / 362880.0;
  s = s * q - 1.0 / 5040.0;
  s = s * q + 1.0 / 120.0;
  s = s * q - 1.0 / 6.0;
  return x + x * q * s;
}

inline double cos_turns(double turns) { return sin_turns(turns + 0.25); }

/// Scrambles 32 bits (Prospecting for Hash Functions, C. Wellons: lowbias32).
constexpr std::uint32_t scramble(std::uint32_t v) {
  v ^= v >> 16;
  v *= 0x7feb352dU;
  v ^= v >> 15;
  v *= 0x846ca68bU;
  v ^= v >> 16;
  return v;
}

/// To be scrambled together with a row's last coordinate.
constexpr std::uint32_t row_key(std::uint64_t seed, std::int64_t y, std::int64_t z) {
  auto key = scramble(static_cast<std::uint32_t>(seed) ^ 0x9e3779b9U);
  key = scramble(key ^ static_cast<std::uint32_t>(seed >> 32));
  key = scramble(key + static_cast<std::uint32_t>(y));
  return scramble(key + static_cast<std::uint32_t>(z));
}

/// In [−1, 1).
template <class Real>
constexpr Real signed_unit(std::uint32_t v) {
  return static_cast<Real>(static_cast<std::int32_t>(v)) * static_cast<Real>(0x1p-31);
}

}  // namespace isobrick
