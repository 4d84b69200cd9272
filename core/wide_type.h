#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// Types of files that are none of ours: samples of them are widened as they are read, without
/// loss. u64 and i64 become f64, f16 becomes f32, and a bool the u8 0 or 1.
enum class WideType : std::uint8_t { u64, i64, f16, boolean };

/// "uint64", "int64", "float16", "bool": the names of Zarr and of NumPy.
constexpr std::string_view zarr_name(WideType type) {
  constexpr std::string_view names[] = {"uint64", "int64", "float16", "bool"};
  return names[static_cast<int>(type)];
}

constexpr std::optional<WideType> parse_wide_type(std::string_view name) {
  for (const WideType type : {WideType::u64, WideType::i64, WideType::f16, WideType::boolean})
    if (name == zarr_name(type)) return type;
  return std::nullopt;
}

/// What a sample becomes.
constexpr ScalarType widened(WideType type) {
  constexpr ScalarType types[] = {ScalarType::f64, ScalarType::f64, ScalarType::f32,
                                  ScalarType::u8};
  return types[static_cast<int>(type)];
}

/// Bytes of a stored sample; no more than those of what it becomes.
constexpr std::size_t size_of(WideType type) {
  constexpr std::size_t sizes[] = {8, 8, 2, 1};
  return sizes[static_cast<int>(type)];
}

/// The type of samples in a file: one of ours, or what is widened to one.
struct StoredType {
  ScalarType type = ScalarType::u8;  ///< of the samples as they are read
  std::optional<WideType> wide;      ///< what is stored, where that is none of our types

  constexpr StoredType() = default;
  constexpr StoredType(ScalarType ours) : type(ours) {}
  constexpr StoredType(WideType stored) : type(widened(stored)), wide(stored) {}

  friend bool operator==(const StoredType&, const StoredType&) = default;
};

/// The name of what is stored, for messages.
constexpr std::string_view short_name(const StoredType& stored) {
  return stored.wide ? zarr_name(*stored.wide) : short_name(stored.type);
}

/// Widens `count` samples, native byte order. `stored` may be the last bytes of `samples`.
/// Throws Error, without a place, naming the first integer that no f64 is.
void widen(WideType type, const std::byte* stored, std::byte* samples, std::size_t count);

/// The float that 16 bits are.
float half_to_float(std::uint16_t bits);

}  // namespace isobrick
