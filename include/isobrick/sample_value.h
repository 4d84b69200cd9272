#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>

#include <isobrick/api.h>
#include <isobrick/scalar.h>

namespace isobrick::inline v0 {

/// The value of a sample of any type, exact also where it is an integer that no double is. It
/// converts from and to numbers; as a double it is the nearest one.
class ISOBRICK_API SampleValue {
 public:
  constexpr SampleValue() = default;
  /// Any number.
  template <class T>
  requires std::is_arithmetic_v<T>
  constexpr SampleValue(T value) : value_(static_cast<double>(value)) {
    if constexpr (std::is_integral_v<T>) {
      kind_ = std::is_signed_v<T> ? Kind::with_sign : Kind::without_sign;
      bits_ = static_cast<std::uint64_t>(value);
    }
  }

  /// The nearest double.
  constexpr operator double() const { return value_; }
  /// The value as an integer, where it is one of 64 bits of this sign.
  std::optional<std::uint64_t> as_unsigned() const;
  std::optional<std::int64_t> as_signed() const;  ///< the same with a sign
  /// As samples of a type hold it: is_sample() is true.
  template <class T>
  T as() const {
    if constexpr (std::is_same_v<T, std::uint64_t>)
      return as_unsigned().value_or(0);
    else if constexpr (std::is_same_v<T, std::int64_t>)
      return as_signed().value_or(0);
    else
      return static_cast<T>(value_);
  }
  /// All digits of an integer; another number as short as it is exact.
  std::string text() const;

  friend bool operator==(const SampleValue& a, const SampleValue& b) {
    return a.value_ == b.value_ && a.as_unsigned() == b.as_unsigned() &&
           a.as_signed() == b.as_signed();
  }
  template <class T>
  requires std::is_arithmetic_v<T>
  friend bool operator==(const SampleValue& a, T b) { return a == SampleValue(b); }

 private:
  enum class Kind : std::uint8_t { fraction, with_sign, without_sign };

  double value_ = 0;
  std::uint64_t bits_ = 0;  ///< of an integer
  Kind kind_ = Kind::fraction;
};

/// Whether samples of the type can have the value. Every number is one of a floating-point type.
ISOBRICK_API bool is_sample(const SampleValue& value, ScalarType type);

}  // namespace isobrick
