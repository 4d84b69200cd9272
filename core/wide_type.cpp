#include "core/wide_type.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <string>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

template <class From, class To, class Convert>
void widen_each(const std::byte* stored, std::byte* samples, std::size_t count, Convert convert) {
  for (std::size_t i = 0; i < count; ++i) {
    From from;
    std::memcpy(&from, stored + i * sizeof(From), sizeof(From));
    const To to = convert(from);
    std::memcpy(samples + i * sizeof(To), &to, sizeof(To));
  }
}

template <class From>
double double_of(From value) {
  const auto as_double = static_cast<double>(value);
  // 2⁶⁴ and 2⁶³, which the largest integers round to, are none of the type.
  constexpr double end = std::is_signed_v<From> ? 0x1p63 : 0x1p64;
  if (!(as_double < end) || static_cast<From>(as_double) != value)
    throw Error("the value " + std::to_string(value) +
                " is no float64 exactly, as which surfaces read 64-bit integers");
  return as_double;
}

}  // namespace

float half_to_float(std::uint16_t bits) {
  const std::uint32_t sign = static_cast<std::uint32_t>(bits & 0x8000u) << 16;
  const std::uint32_t exponent = bits >> 10 & 31u, fraction = bits & 0x3ffu;
  if (exponent == 0) {
    const float tiny = std::ldexp(static_cast<float>(fraction), -24);
    return sign ? -tiny : tiny;
  }
  const std::uint32_t wide = exponent == 31 ? 255u : exponent + 112u;
  return std::bit_cast<float>(sign | wide << 23 | fraction << 13);
}

void widen(WideType type, const std::byte* stored, std::byte* samples, std::size_t count) {
  switch (type) {
    case WideType::f16:
      return widen_each<std::uint16_t, float>(stored, samples, count, half_to_float);
    case WideType::boolean:
      return widen_each<std::uint8_t, std::uint8_t>(
          stored, samples, count, [](std::uint8_t v) { return static_cast<std::uint8_t>(v != 0); });
  }
}

double exact_double(std::uint64_t value) { return double_of(value); }
double exact_double(std::int64_t value) { return double_of(value); }

void make_surface_samples(ScalarType type, std::byte* samples, std::size_t count) {
  if (type == ScalarType::u64)
    widen_each<std::uint64_t, double>(samples, samples, count, double_of<std::uint64_t>);
  else if (type == ScalarType::i64)
    widen_each<std::int64_t, double>(samples, samples, count, double_of<std::int64_t>);
}

}  // namespace isobrick
