#include "io/bytes/concat_stream.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

class ConcatStream final : public ByteStream {
 public:
  ConcatStream(std::string name, std::size_t count,
               std::function<std::unique_ptr<ByteStream>(std::size_t)> open)
      : name_(std::move(name)), count_(count), open_(std::move(open)), part_(open_(0)) {
    memory_ = part_->memory();
    const std::uint64_t most = part_->max_bytes();
    max_ = most > std::numeric_limits<std::uint64_t>::max() / count ? most : most * count;
  }

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size && index_ < count_) {
      if (!part_) part_ = open_(index_);
      const std::size_t got = part_->read(out + done, size - done);
      done += got;
      part_bytes_ += got;
      if (done == size) break;
      end_part();
    }
    return done;
  }

  std::string name() const override { return name_; }
  std::uint64_t max_bytes() const override { return max_; }
  std::size_t memory() const override { return memory_; }

 private:
  void end_part() {
    if (index_ == 0) first_bytes_ = part_bytes_;
    if (part_bytes_ != first_bytes_)
      throw UsageError(fmt::format("{} holds {} bytes of samples, but the first of {} holds {}",
                                   part_->name(), part_bytes_, name_, first_bytes_));
    part_.reset();
    part_bytes_ = 0;
    ++index_;
  }

  std::string name_;
  std::size_t count_, index_ = 0;
  std::function<std::unique_ptr<ByteStream>(std::size_t)> open_;
  std::unique_ptr<ByteStream> part_;
  std::size_t memory_ = 0;
  std::uint64_t max_ = 0, part_bytes_ = 0, first_bytes_ = 0;
};

}  // namespace

std::unique_ptr<ByteStream> make_concat_stream(
    std::string name, std::size_t count,
    std::function<std::unique_ptr<ByteStream>(std::size_t)> open) {
  return std::make_unique<ConcatStream>(std::move(name), count, std::move(open));
}

}  // namespace isobrick
