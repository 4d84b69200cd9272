#include <isobrick/label.h>

#include <charconv>

namespace isobrick::inline v0 {
namespace {

template <class T>
std::optional<Label> parse_whole_label(std::string_view text) {
  T value = 0;
  const char* const last = text.data() + text.size();
  const auto [end, failure] = std::from_chars(text.data(), last, value);
  return failure == std::errc() && end == last ? std::optional(Label(value)) : std::nullopt;
}

}  // namespace

std::optional<Label> Label::parse(std::string_view text) {
  if (text.starts_with('-')) return parse_whole_label<std::int64_t>(text);
  return parse_whole_label<std::uint64_t>(text);
}

std::string Label::text() const {
  return is_negative_ ? std::to_string(static_cast<std::int64_t>(bits_)) : std::to_string(bits_);
}

}  // namespace isobrick
