#include "io/bytes/zlib_block_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/inflate.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kMaxBlock = std::uint64_t{64} << 20;

class ZlibBlockStream final : public ByteStream {
 public:
  ZlibBlockStream(const BlockTable& table, std::unique_ptr<ByteStream> sizes,
                  std::unique_ptr<ByteStream> packed)
      : table_(table), sizes_(std::move(sizes)), packed_(std::move(packed)) {
    if (table_.block_bytes == 0 || table_.block_bytes > kMaxBlock ||
        table_.last_bytes > table_.block_bytes)
      throw UsageError(
          fmt::format("{}: compressed blocks of {} bytes, the last one of {}, make no "
                      "sense (at most {} are supported)",
                      packed_->name(), table_.block_bytes, table_.last_bytes, kMaxBlock));
    if (table_.blocks > sizes_->max_bytes() / static_cast<std::uint64_t>(table_.entry_bytes))
      throw UsageError(fmt::format("{}: the file has no room for the sizes of {} compressed blocks",
                                   packed_->name(), table_.blocks));
    if (table_.last_bytes == 0) table_.last_bytes = table_.block_bytes;
    block_.resize(table_.block_bytes);
    input_.resize(max_deflated(table_.block_bytes));
  }

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size) {
      if (at_ == end_) {
        if (index_ == table_.blocks) break;
        // A whole block that is wanted goes straight to where it is wanted.
        const std::size_t bytes = next_bytes();
        const bool whole = size - done >= bytes;
        next_block(whole ? out + done : block_.data());
        at_ = whole ? bytes : 0;
        end_ = bytes;
        if (whole) done += bytes;
        continue;
      }
      const std::size_t count = std::min(size - done, end_ - at_);
      std::memcpy(out + done, block_.data() + at_, count);
      at_ += count;
      done += count;
    }
    return done;
  }

  std::string name() const override { return packed_->name(); }
  std::uint64_t max_bytes() const override {
    return table_.blocks == 0 ? 0 : (table_.blocks - 1) * table_.block_bytes + table_.last_bytes;
  }
  std::size_t memory() const override {
    return sizes_->memory() + packed_->memory() + block_.size() + input_.size();
  }

 private:
  /// Of the next block, unpacked.
  std::size_t next_bytes() const {
    return static_cast<std::size_t>(index_ + 1 == table_.blocks ? table_.last_bytes
                                                                : table_.block_bytes);
  }

  void next_block(std::byte* out) {
    const std::uint64_t packed =
        sizes_->read_unsigned(static_cast<std::size_t>(table_.entry_bytes), table_.swap);
    const std::size_t bytes = next_bytes();
    if (packed > input_.size())
      throw DamageError(
          fmt::format("{}: compressed block {} would have {} bytes, more than any of "
                      "{} unpacked",
                      name(), index_, packed, bytes));
    packed_->read_exactly(input_.data(), static_cast<std::size_t>(packed));
    const InflateResult done = inflate(
        Wrapper::zlib, std::span(input_).first(static_cast<std::size_t>(packed)), {out, bytes});
    if (!done.filled(bytes))
      throw DamageError(
          fmt::format("{}: compressed block {} is damaged (code {})", name(), index_, done.code));
    ++index_;
  }

  BlockTable table_;
  std::unique_ptr<ByteStream> sizes_, packed_;
  std::vector<std::byte> block_, input_;
  std::size_t at_ = 0, end_ = 0;
  std::uint64_t index_ = 0;
};

}  // namespace

std::unique_ptr<ByteStream> make_zlib_block_stream(const BlockTable& table,
                                                   std::unique_ptr<ByteStream> sizes,
                                                   std::unique_ptr<ByteStream> packed) {
  return std::make_unique<ZlibBlockStream>(table, std::move(sizes), std::move(packed));
}

}  // namespace isobrick
