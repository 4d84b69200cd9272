#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

namespace isobrick::inline v0 {

/// The sample types of a store. Surfaces are made of the first eight; 64-bit integers are labels,
/// and what makes surfaces reads them as f64.
enum class ScalarType : std::uint8_t { u8, i8, u16, i16, u32, i32, f32, f64, u64, i64 };

/// All of them.
inline constexpr ScalarType kScalarTypes[] = {
    ScalarType::u8,  ScalarType::i8,  ScalarType::u16, ScalarType::i16, ScalarType::u32,
    ScalarType::i32, ScalarType::f32, ScalarType::f64, ScalarType::u64, ScalarType::i64};

/// Those that surfaces, slices and search structures are made of.
inline constexpr ScalarType kSurfaceTypes[] = {ScalarType::u8,  ScalarType::i8,  ScalarType::u16,
                                               ScalarType::i16, ScalarType::u32, ScalarType::i32,
                                               ScalarType::f32, ScalarType::f64};

/// The sample type that is `T` in C++.
template <class T>
inline constexpr ScalarType scalar_type_of = [] {
  if constexpr (std::is_same_v<T, std::uint8_t>)
    return ScalarType::u8;
  else if constexpr (std::is_same_v<T, std::int8_t>)
    return ScalarType::i8;
  else if constexpr (std::is_same_v<T, std::uint16_t>)
    return ScalarType::u16;
  else if constexpr (std::is_same_v<T, std::int16_t>)
    return ScalarType::i16;
  else if constexpr (std::is_same_v<T, std::uint32_t>)
    return ScalarType::u32;
  else if constexpr (std::is_same_v<T, std::int32_t>)
    return ScalarType::i32;
  else if constexpr (std::is_same_v<T, float>)
    return ScalarType::f32;
  else if constexpr (std::is_same_v<T, std::uint64_t>)
    return ScalarType::u64;
  else if constexpr (std::is_same_v<T, std::int64_t>)
    return ScalarType::i64;
  else {
    static_assert(std::is_same_v<T, double>, "not a sample type");
    return ScalarType::f64;
  }
}();

/// Carries a type as a value.
template <class T>
struct TypeTag {
  /// The type.
  using type = T;
};

/// Whether samples are integers of 64 bits, of which f64 does not hold all.
constexpr bool is_wide_integer(ScalarType type) {
  return type == ScalarType::u64 || type == ScalarType::i64;
}

/// What surfaces read samples of the type as; also the type of the ranges of a volume.
constexpr ScalarType surface_type(ScalarType type) {
  return is_wide_integer(type) ? ScalarType::f64 : type;
}

/// Calls f(TypeTag<T>{}) with the C++ type of `type`, one of kSurfaceTypes; every branch returns
/// the same type. Throws std::invalid_argument for another one.
template <class F>
constexpr decltype(auto) visit_scalar(ScalarType type, F&& f) {
  switch (type) {
    case ScalarType::u8: return std::forward<F>(f)(TypeTag<std::uint8_t>{});
    case ScalarType::i8: return std::forward<F>(f)(TypeTag<std::int8_t>{});
    case ScalarType::u16: return std::forward<F>(f)(TypeTag<std::uint16_t>{});
    case ScalarType::i16: return std::forward<F>(f)(TypeTag<std::int16_t>{});
    case ScalarType::u32: return std::forward<F>(f)(TypeTag<std::uint32_t>{});
    case ScalarType::i32: return std::forward<F>(f)(TypeTag<std::int32_t>{});
    case ScalarType::f32: return std::forward<F>(f)(TypeTag<float>{});
    case ScalarType::f64: break;
    case ScalarType::u64:
    case ScalarType::i64:
      throw std::invalid_argument("64-bit integers are read as float64 where surfaces are made");
  }
  return std::forward<F>(f)(TypeTag<double>{});
}

/// The same for all of kScalarTypes.
template <class F>
constexpr decltype(auto) visit_sample(ScalarType type, F&& f) {
  if (type == ScalarType::u64) return std::forward<F>(f)(TypeTag<std::uint64_t>{});
  if (type == ScalarType::i64) return std::forward<F>(f)(TypeTag<std::int64_t>{});
  return visit_scalar(type, std::forward<F>(f));
}

/// Bytes of a sample.
constexpr std::size_t size_of(ScalarType type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8, 8, 8};
  return sizes[static_cast<int>(type)];
}

/// Whether samples are floating-point numbers.
constexpr bool is_floating(ScalarType type) {
  return type == ScalarType::f32 || type == ScalarType::f64;
}

/// The type that holds every sample of `type`, and NaN; of 64-bit integers those that are a f64.
constexpr ScalarType type_with_nan(ScalarType type) {
  if (is_floating(type)) return type;
  return size_of(type) >= 4 ? ScalarType::f64 : ScalarType::f32;
}

/// `value` as samples of the type hold it: -1e30 is no float, and the nearest one is meant. A
/// number beyond all floats stays, and no sample has it.
inline double as_sample(double value, ScalarType type) {
  const bool fits = std::abs(value) <= static_cast<double>(std::numeric_limits<float>::max());
  return type == ScalarType::f32 && fits ? static_cast<double>(static_cast<float>(value)) : value;
}

/// "u8", "i16", "f32", …: the names of the command line.
constexpr std::string_view short_name(ScalarType type) {
  constexpr std::string_view names[] = {"u8",  "i8",  "u16", "i16", "u32",
                                        "i32", "f32", "f64", "u64", "i64"};
  return names[static_cast<int>(type)];
}

/// "uint8", "int16", "float32", …: the names of Zarr and of NumPy.
constexpr std::string_view zarr_name(ScalarType type) {
  constexpr std::string_view names[] = {"uint8", "int8",    "uint16",  "int16",  "uint32",
                                        "int32", "float32", "float64", "uint64", "int64"};
  return names[static_cast<int>(type)];
}

/// The type with this short or Zarr name.
constexpr std::optional<ScalarType> parse_scalar_type(std::string_view name) {
  for (ScalarType type : kScalarTypes)
    if (name == short_name(type) || name == zarr_name(type)) return type;
  return std::nullopt;
}

}  // namespace isobrick
