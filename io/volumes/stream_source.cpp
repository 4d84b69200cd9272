#include "io/volumes/stream_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <utility>
#include <vector>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

class StreamSource final : public VolumeSource {
 public:
  StreamSource(SampleLayout layout, std::unique_ptr<ByteStream> stream, std::uint64_t end,
               AfterEnd after_end)
      : layout_(std::move(layout)), stream_(std::move(stream)), end_(end), after_end_(after_end) {
    if (stream_->max_bytes() < layout_.end())
      throw UsageError(fmt::format(
          "{} can hold at most {} bytes of samples, but its header{} "
          "promises {}",
          stream_->name(), stream_->max_bytes(), layout_.header_in_message(), layout_.end()));
  }

  const VolumeInfo& info() const override { return layout_.info; }
  bool random_access() const override { return false; }
  std::size_t memory() const override { return stream_->memory(); }
  std::vector<std::string> notes() const override { return layout_.notes; }

  void read(Box3 box, std::byte* out) override {
    assert(box.lo.z >= next_plane_ && "planes of a stream come in order, each once");
    read_samples(
        layout_, box,
        [&](std::uint64_t offset, std::byte* to, std::size_t size) { fetch(offset, to, size); },
        out);
    next_plane_ = box.hi.z;
    if (next_plane_ == layout_.info.extent.z) expect_end();
  }

 private:
  void fetch(std::uint64_t offset, std::byte* out, std::size_t size) {
    if (offset > position_) {
      stream_->skip(offset - position_);
      position_ = offset;
    }
    const std::size_t got = stream_->read(out, size);
    position_ += got;
    if (got < size)
      throw UsageError(fmt::format("{} ended after {} bytes, {} were expected{}", stream_->name(),
                                   position_, end_,
                                   layout_.header.empty() ? "" : " by '" + layout_.header + "'"));
  }

  /// Where the last sample is (nearly) the last byte, the stream must end: that
  /// is also where its checksums are compared.
  void expect_end() {
    constexpr std::uint64_t most = 1 << 20;
    if (after_end_ == AfterEnd::unread || end_ - position_ > most) return;
    stream_->skip(end_ - position_);
    // Counted only so far: the rest of an endless stream would never be.
    std::vector<std::byte> rest(most);
    const std::size_t extra = stream_->read(rest.data(), most);
    if (extra > 0 && after_end_ == AfterEnd::refused)
      throw UsageError(fmt::format("{} goes on after the {} bytes expected: {}{} more",
                                   stream_->name(), end_, extra == most ? "at least " : "", extra));
    note_rest(extra, extra == most);
  }

  void note_rest(std::size_t extra, bool at_least) {
    const bool text = after_end_ == AfterEnd::noted_as_numbers;
    const std::size_t count = text ? extra / size_of(layout_.info.type) : extra;
    if (count > 0)
      layout_.notes.push_back(
          trailing_note(stream_->name(), count, text ? "number" : "byte", "the samples", at_least));
    if (const std::uint64_t left_over = stream_->left_over(); left_over > 0)
      layout_.notes.push_back(
          trailing_note(stream_->name(), left_over, "byte", "the compressed data"));
  }

  SampleLayout layout_;
  std::unique_ptr<ByteStream> stream_;
  std::uint64_t end_;
  AfterEnd after_end_;
  std::uint64_t position_ = 0;
  Index next_plane_ = 0;
};

}  // namespace

std::unique_ptr<VolumeSource> make_stream_source(SampleLayout layout,
                                                 std::unique_ptr<ByteStream> stream,
                                                 std::uint64_t end, AfterEnd after_end) {
  return std::make_unique<StreamSource>(std::move(layout), std::move(stream), end, after_end);
}

}  // namespace isobrick
