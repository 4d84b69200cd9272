#include "io/bytes/text_stream.h"

#include <fmt/format.h>
#include <locale.h>
#include <stdlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kBuffer = 65536;
/// No number that anybody writes is longer.
constexpr std::size_t kMaxWord = 400;

/// A comma counts as one: teem reads "1, 2, 3" too.
bool is_blank(char c) { return c == ' ' || c == ',' || (c >= '\t' && c <= '\r') || c == '\0'; }

/// A number as strtod() rounds it, in any locale.
double rounded(std::string_view number) {
  static const locale_t c_locale = ::newlocale(LC_ALL_MASK, "C", nullptr);
  return ::strtod_l(std::string(number).c_str(), nullptr, c_locale);
}

/// The value of a word, if it is a number that T holds.
template <class T>
bool parse(std::string_view word, T& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  const char* const end = word.data() + word.size();
  const auto [at, error] = std::from_chars(word.data(), end, value);
  if (error == std::errc{} && at == end) return true;
  if constexpr (std::is_floating_point_v<T>) {
    // Only a number beyond the type's range is left: it is infinite or zero.
    if (error != std::errc::result_out_of_range || at != end) return false;
    value = static_cast<T>(rounded(word));
    return true;
  } else {
    double whole = 0;
    const auto [last, failure] = std::from_chars(word.data(), end, whole);
    if (failure != std::errc{} || last != end || std::trunc(whole) != whole ||
        whole < static_cast<double>(std::numeric_limits<T>::min()) ||
        whole > static_cast<double>(std::numeric_limits<T>::max()))
      return false;
    // A double may have rounded what is longer.
    if (sizeof(T) == 8 && std::abs(whole) >= 0x1p53) return false;
    value = static_cast<T>(whole);
    return true;
  }
}

class TextStream final : public ByteStream {
 public:
  TextStream(std::unique_ptr<ByteStream> text, ScalarType type)
      : text_(std::move(text)),
        type_(type),
        buffer_(std::make_unique_for_overwrite<char[]>(kBuffer)) {}

  std::size_t read(std::byte* out, std::size_t size) override {
    return visit_sample(type_,
                        [&](auto tag) { return read_as<typename decltype(tag)::type>(out, size); });
  }

  std::string name() const override { return text_->name(); }
  /// A number takes a digit and a blank, the last one no blank.
  std::uint64_t max_bytes() const override {
    const std::uint64_t text = text_->max_bytes(), numbers = text / 2 + text % 2;
    return numbers > std::numeric_limits<std::uint64_t>::max() / size_of(type_)
               ? std::numeric_limits<std::uint64_t>::max()
               : numbers * size_of(type_);
  }
  std::size_t memory() const override { return text_->memory() + kBuffer; }

 private:
  template <class T>
  std::size_t read_as(std::byte* out, std::size_t size) {
    std::size_t done = 0;
    for (; done + sizeof(T) <= size; done += sizeof(T)) {
      const std::string_view word = next_word();
      if (word.empty()) break;
      T value{};
      if (!parse(word, value)) refuse(word);
      std::memcpy(out + done, &value, sizeof(T));
    }
    return done;
  }

  /// The next number's text, or nothing at the end.
  std::string_view next_word() {
    for (;;) {
      while (begin_ < end_ && is_blank(buffer_[begin_])) ++begin_;
      std::size_t at = begin_;
      while (at < end_ && !is_blank(buffer_[at])) ++at;
      if (at < end_ || (ended_ && at > begin_)) {
        const std::string_view word(&buffer_[begin_], at - begin_);
        begin_ = at;
        return word;
      }
      if (ended_) return {};
      if (at - begin_ > kMaxWord) refuse({&buffer_[begin_], at - begin_});
      refill();
    }
  }

  void refill() {
    std::copy(&buffer_[begin_], &buffer_[0] + end_, &buffer_[0]);
    consumed_ += begin_;
    end_ -= begin_;
    begin_ = 0;
    const std::size_t room = kBuffer - end_;
    const std::size_t got = text_->read(reinterpret_cast<std::byte*>(&buffer_[end_]), room);
    ended_ = got < room;
    end_ += got;
  }

  [[noreturn]] void refuse(std::string_view word) const {
    throw Error(fmt::format("{}: '{}', before byte {} of its numbers, is no number of type {}",
                            name(), printable(word, 40), consumed_ + begin_, short_name(type_)));
  }

  std::unique_ptr<ByteStream> text_;
  ScalarType type_;
  std::unique_ptr<char[]> buffer_;
  std::size_t begin_ = 0, end_ = 0;  ///< of what is in the buffer and was not parsed
  std::uint64_t consumed_ = 0;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<ByteStream> make_text_stream(std::unique_ptr<ByteStream> text, ScalarType type) {
  return std::make_unique<TextStream>(std::move(text), type);
}

}  // namespace isobrick
