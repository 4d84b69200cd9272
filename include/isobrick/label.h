#pragma once

#include <compare>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include <isobrick/api.h>

namespace isobrick::inline v0 {

/// The value that all samples of an object have in a label image: an integer from −2⁶³ to 2⁶⁴ − 1,
/// so that it may be any sample of i64 and of u64. It converts from integers, and is equal and
/// ordered as these are.
class ISOBRICK_API Label {
 public:
  constexpr Label() = default;  ///< 0
  /// Any integer.
  template <std::integral T>
  requires(!std::is_same_v<T, bool>) constexpr Label(T value)
      : bits_(static_cast<std::uint64_t>(value)) {
    if constexpr (std::is_signed_v<T>) is_negative_ = value < 0;
  }

  /// The label that a text has in decimal; nothing where it is no such integer.
  static std::optional<Label> parse(std::string_view text);

  /// As a sample of 64 bits holds it: a negative one in two's complement.
  constexpr std::uint64_t bits() const { return bits_; }
  /// The label as an integer with a sign, where it is one of 64 bits.
  constexpr std::optional<std::int64_t> as_signed() const {
    constexpr auto most = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    if (!is_negative_ && bits_ > most) return std::nullopt;
    return static_cast<std::int64_t>(bits_);
  }
  /// The label as an integer without a sign, where it is one.
  constexpr std::optional<std::uint64_t> as_unsigned() const {
    return is_negative_ ? std::nullopt : std::optional(bits_);
  }
  /// The nearest double.
  explicit constexpr operator double() const {
    return is_negative_ ? static_cast<double>(static_cast<std::int64_t>(bits_))
                        : static_cast<double>(bits_);
  }
  /// In decimal, with all digits.
  std::string text() const;

  /// As integers.
  friend constexpr bool operator==(const Label& a, const Label& b) = default;
  /// As integers.
  friend constexpr std::strong_ordering operator<=>(const Label& a, const Label& b) {
    if (a.is_negative_ != b.is_negative_) return b.is_negative_ <=> a.is_negative_;
    return a.bits_ <=> b.bits_;
  }

 private:
  std::uint64_t bits_ = 0;
  bool is_negative_ = false;
};

}  // namespace isobrick
