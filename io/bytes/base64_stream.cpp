#include "io/bytes/base64_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kBuffer = 65536;

constexpr std::uint8_t kBlank = 64, kPadding = 65, kEnd = 66, kWrong = 67;

constexpr std::array<std::uint8_t, 256> make_table() {
  std::array<std::uint8_t, 256> table{};
  table.fill(kWrong);
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::uint8_t i = 0; i < 64; ++i) table[static_cast<std::uint8_t>(digits[i])] = i;
  for (const char c : {' ', '\t', '\n', '\r'}) table[static_cast<std::uint8_t>(c)] = kBlank;
  table['='] = kPadding;
  table['<'] = kEnd;
  return table;
}
constexpr auto kTable = make_table();

/// The characters of a text, one by one or as they lie in a buffer.
class Characters {
 public:
  explicit Characters(std::unique_ptr<ByteStream> text)
      : text_(std::move(text)), buffer_(std::make_unique_for_overwrite<std::uint8_t[]>(kBuffer)) {}

  bool refill() {
    if (at_ < end_) return true;
    at_ = 0;
    end_ = text_->read(reinterpret_cast<std::byte*>(buffer_.get()), kBuffer);
    return end_ > 0;
  }
  const std::uint8_t* data() const { return &buffer_[at_]; }
  std::size_t size() const { return end_ - at_; }
  void pass(std::size_t count) { at_ += count; }
  const ByteStream& text() const { return *text_; }

 private:
  std::unique_ptr<ByteStream> text_;
  std::unique_ptr<std::uint8_t[]> buffer_;
  std::size_t at_ = 0, end_ = 0;
};

class Base64Stream final : public ByteStream {
 public:
  explicit Base64Stream(std::unique_ptr<ByteStream> text) : text_(std::move(text)) {}

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = take_rest(out, size);
    while (done < size && !ended_ && text_.refill()) {
      done += decode_quads(out + done, size - done);
      if (done == size || text_.size() == 0) continue;
      add(*text_.data());
      text_.pass(1);
      done += take_rest(out + done, size - done);
    }
    if (done < size && (ended_ || text_.size() == 0) && digits_ > 0)
      throw Error(fmt::format("{}: its base64 text ends within a byte", name()));
    return done;
  }

  std::string name() const override { return text_.text().name(); }
  std::uint64_t max_bytes() const override { return text_.text().max_bytes() / 4 * 3; }
  std::size_t memory() const override { return text_.text().memory() + kBuffer; }

 private:
  /// The common case: four digits without anything between.
  std::size_t decode_quads(std::byte* out, std::size_t size) {
    if (digits_ > 0 || rest_size_ > 0) return 0;
    const std::uint8_t* in = text_.data();
    const std::size_t quads = std::min(text_.size() / 4, size / 3);
    std::size_t q = 0;
    for (; q < quads; ++q, in += 4, out += 3) {
      const std::uint32_t a = kTable[in[0]], b = kTable[in[1]], c = kTable[in[2]],
                          d = kTable[in[3]];
      if ((a | b | c | d) >= 64) break;
      const std::uint32_t bits = a << 18 | b << 12 | c << 6 | d;
      out[0] = static_cast<std::byte>(bits >> 16);
      out[1] = static_cast<std::byte>(bits >> 8 & 0xff);
      out[2] = static_cast<std::byte>(bits & 0xff);
    }
    text_.pass(4 * q);
    return 3 * q;
  }

  void add(std::uint8_t c) {
    const std::uint8_t value = kTable[c];
    if (value == kBlank) return;
    if (value == kEnd) {
      ended_ = true;
      return;
    }
    if (value == kWrong || (value == kPadding && digits_ < 2) ||
        (value != kPadding && padding_ > 0))
      throw Error(fmt::format("{}: a character with the code {} is not base64", name(), c));
    bits_ = bits_ << 6 | (value == kPadding ? 0u : value);
    padding_ += value == kPadding;
    if (++digits_ == 4) end_quad();
  }

  void end_quad() {
    rest_ = {static_cast<std::byte>(bits_ >> 16 & 0xff), static_cast<std::byte>(bits_ >> 8 & 0xff),
             static_cast<std::byte>(bits_ & 0xff)};
    rest_size_ = 3 - padding_;
    rest_at_ = 0;
    digits_ = padding_ = 0;
    bits_ = 0;
  }

  /// Bytes of a quad that was put together one by one.
  std::size_t take_rest(std::byte* out, std::size_t size) {
    const std::size_t count = std::min(size, rest_size_);
    std::memcpy(out, rest_.data() + rest_at_, count);
    rest_at_ += count;
    rest_size_ -= count;
    return count;
  }

  Characters text_;
  std::uint32_t bits_ = 0;
  std::size_t digits_ = 0, padding_ = 0;
  std::array<std::byte, 3> rest_{};
  std::size_t rest_at_ = 0, rest_size_ = 0;
  bool ended_ = false;
};

class ElementStream final : public ByteStream {
 public:
  explicit ElementStream(std::unique_ptr<ByteStream> text) : text_(std::move(text)) {}

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size && !ended_ && text_.refill()) {
      const std::uint8_t* begin = text_.data();
      const std::size_t most = std::min(size - done, text_.size());
      const std::uint8_t* end = std::find(begin, begin + most, std::uint8_t{'<'});
      const auto count = static_cast<std::size_t>(end - begin);
      ended_ = count < most;
      std::memcpy(out + done, begin, count);
      text_.pass(count);
      done += count;
    }
    return done;
  }

  std::string name() const override { return text_.text().name(); }
  std::uint64_t max_bytes() const override { return text_.text().max_bytes(); }
  std::size_t memory() const override { return text_.text().memory() + kBuffer; }

 private:
  Characters text_;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<ByteStream> make_base64_stream(std::unique_ptr<ByteStream> text) {
  return std::make_unique<Base64Stream>(std::move(text));
}

std::unique_ptr<ByteStream> make_element_stream(std::unique_ptr<ByteStream> text) {
  return std::make_unique<ElementStream>(std::move(text));
}

}  // namespace isobrick
