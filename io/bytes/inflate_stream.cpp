#include "io/bytes/inflate_stream.h"

#include <fmt/format.h>
#include <isa-l/igzip_lib.h>

#include <algorithm>
#include <limits>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kInput = 256 * 1024;
/// No deflate stream unpacks to more than this many times its bytes.
constexpr std::uint64_t kMaxRatio = 1032;

class InflateStream final : public ByteStream {
 public:
  InflateStream(std::unique_ptr<ByteStream> packed, Wrapper wrapper)
      : packed_(std::move(packed)),
        wrapper_(wrapper),
        state_(std::make_unique<inflate_state>()),
        input_(std::make_unique_for_overwrite<std::byte[]>(kInput)) {
    isal_inflate_init(state_.get());
    state_->avail_in = 0;
    begin_member();
  }

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size && !ended_) {
      refill();
      if (between_members_ && !next_member()) break;
      done += inflate(out + done, std::min(size - done, std::size_t{1} << 30));
    }
    return done;
  }

  std::string name() const override { return packed_->name(); }

  std::uint64_t max_bytes() const override {
    const std::uint64_t packed = packed_->max_bytes();
    return packed > std::numeric_limits<std::uint64_t>::max() / kMaxRatio
               ? std::numeric_limits<std::uint64_t>::max()
               : packed * kMaxRatio;
  }

  std::uint64_t left_over() const override {
    return ended_ ? packed_->max_bytes() - fetched_ + state_->avail_in : 0;
  }

  std::size_t memory() const override { return packed_->memory() + sizeof(inflate_state) + kInput; }

 private:
  void begin_member() {
    state_->crc_flag = wrapper_ == Wrapper::gzip ? ISAL_GZIP : ISAL_ZLIB;
    between_members_ = false;
  }

  /// Sees to it that there is input unless there is no more.
  void refill() {
    if (state_->avail_in > 0 || packed_ended_) return;
    const std::size_t got = packed_->read(input_.get(), kInput);
    packed_ended_ = got < kInput;
    fetched_ += got;
    state_->next_in = reinterpret_cast<std::uint8_t*>(input_.get());
    state_->avail_in = static_cast<std::uint32_t>(got);
  }

  /// Members follow one another without a gap; anything else is no member.
  bool next_member() {
    constexpr std::uint8_t kFirst = 0x1f;
    ended_ = wrapper_ != Wrapper::gzip || state_->avail_in == 0 || *state_->next_in != kFirst;
    if (ended_) return false;
    isal_inflate_reset(state_.get());
    begin_member();
    return true;
  }

  std::size_t inflate(std::byte* out, std::size_t size) {
    const bool starved = state_->avail_in == 0;
    state_->next_out = reinterpret_cast<std::uint8_t*>(out);
    state_->avail_out = static_cast<std::uint32_t>(size);
    const int result = isal_inflate(state_.get());
    const std::size_t got = size - state_->avail_out;
    position_ += got;
    if (result != ISAL_DECOMP_OK && result != ISAL_END_INPUT)
      throw DamageError(
          fmt::format("{}: the compressed data are damaged {} bytes after their "
                      "beginning (unpacked): {}",
                      name(), position_, reason(result)));
    if (state_->block_state == ISAL_BLOCK_FINISH)
      between_members_ = true;
    else if (starved && got == 0)
      throw DamageError(fmt::format(
          "{}: the compressed data end too early, after {} bytes unpacked", name(), position_));
    return got;
  }

  static const char* reason(int result) {
    switch (result) {
      case ISAL_INCORRECT_CHECKSUM: return "the checksum is wrong";
      case ISAL_INVALID_WRAPPER: return "the header is wrong";
      case ISAL_UNSUPPORTED_METHOD: return "the method is not deflate";
      default: return "not a deflate stream";
    }
  }

  std::unique_ptr<ByteStream> packed_;
  Wrapper wrapper_;
  std::unique_ptr<inflate_state> state_;
  std::unique_ptr<std::byte[]> input_;
  std::uint64_t position_ = 0, fetched_ = 0;  ///< bytes unpacked; bytes taken from `packed_`
  bool packed_ended_ = false, between_members_ = false, ended_ = false;
};

}  // namespace

std::unique_ptr<ByteStream> make_inflate_stream(std::unique_ptr<ByteStream> packed,
                                                Wrapper wrapper) {
  return std::make_unique<InflateStream>(std::move(packed), wrapper);
}

}  // namespace isobrick
