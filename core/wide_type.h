#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// Types of files that are none of ours: samples of them are widened as they are read, without
/// loss. f16 becomes f32, and a bool the u8 0 or 1.
enum class WideType : std::uint8_t { f16, boolean };

/// "float16", "bool": the names of Zarr and of NumPy.
constexpr std::string_view zarr_name(WideType type) {
  return type == WideType::f16 ? "float16" : "bool";
}

constexpr std::optional<WideType> parse_wide_type(std::string_view name) {
  for (const WideType type : {WideType::f16, WideType::boolean})
    if (name == zarr_name(type)) return type;
  return std::nullopt;
}

/// What a sample becomes.
constexpr ScalarType widened(WideType type) {
  return type == WideType::f16 ? ScalarType::f32 : ScalarType::u8;
}

/// Bytes of a stored sample; no more than those of what it becomes.
constexpr std::size_t size_of(WideType type) { return type == WideType::f16 ? 2 : 1; }

/// Widens `count` samples, native byte order. `stored` may be the last bytes of `samples`.
void widen(WideType type, const std::byte* stored, std::byte* samples, std::size_t count);

/// What surfaces read of `count` samples: 64-bit integers become f64 in place, other samples stay.
/// Throws Error, without a place, naming the first integer that no f64 is.
void make_surface_samples(ScalarType type, std::byte* samples, std::size_t count);

/// The number that an integer of 64 bits is. Throws Error where no f64 is it.
double exact_double(std::uint64_t value);
double exact_double(std::int64_t value);

/// The float that 16 bits are.
float half_to_float(std::uint16_t bits);

}  // namespace isobrick
