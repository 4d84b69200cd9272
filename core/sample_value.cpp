#include <isobrick/sample_value.h>

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

namespace isobrick::inline v0 {

std::optional<std::uint64_t> SampleValue::as_unsigned() const {
  if (kind_ == Kind::without_sign) return bits_;
  if (kind_ == Kind::with_sign) {
    if (static_cast<std::int64_t>(bits_) < 0) return std::nullopt;
    return bits_;
  }
  if (!(value_ >= 0 && value_ < 0x1p64) || std::trunc(value_) != value_) return std::nullopt;
  return static_cast<std::uint64_t>(value_);
}

std::optional<std::int64_t> SampleValue::as_signed() const {
  if (kind_ == Kind::with_sign) return static_cast<std::int64_t>(bits_);
  if (kind_ == Kind::without_sign) {
    if (bits_ > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
      return std::nullopt;
    return static_cast<std::int64_t>(bits_);
  }
  if (!(value_ >= -0x1p63 && value_ < 0x1p63) || std::trunc(value_) != value_) return std::nullopt;
  return static_cast<std::int64_t>(value_);
}

std::string SampleValue::text() const {
  switch (kind_) {
    case Kind::with_sign: return std::to_string(static_cast<std::int64_t>(bits_));
    case Kind::without_sign: return std::to_string(bits_);
    case Kind::fraction: break;
  }
  std::array<char, 32> text;
  const auto [end, failure] = std::to_chars(text.data(), text.data() + text.size(), value_);
  return {text.data(), end};
}

bool is_sample(const SampleValue& value, ScalarType type) {
  if (is_floating(type)) return true;
  if (type == ScalarType::u64) return value.as_unsigned().has_value();
  const auto integer = value.as_signed();
  if (type == ScalarType::i64 || !integer) return integer.has_value();
  return visit_scalar(type, [&](auto tag) {
    using Limits = std::numeric_limits<typename decltype(tag)::type>;
    const auto number = static_cast<double>(*integer);
    return number >= static_cast<double>(Limits::lowest()) &&
           number <= static_cast<double>(Limits::max());
  });
}

}  // namespace isobrick
