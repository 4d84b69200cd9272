#include "isobrick/io/raw_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <vector>

#include "isobrick/core/cancel.h"
#include "isobrick/core/error.h"
#include "isobrick/io/byte_order.h"

namespace isobrick {
namespace {

/// Byte arithmetic in a layout whose volume was checked not to overflow.
struct Strides {
  explicit Strides(const RawLayout& layout)
      : sample(size_of(layout.info.type)),
        row(sample * static_cast<std::uint64_t>(layout.info.extent.x)),
        plane(row * static_cast<std::uint64_t>(layout.info.extent.y)),
        volume(plane * static_cast<std::uint64_t>(layout.info.extent.z)) {}

  std::uint64_t of(Int3 p) const {
    return static_cast<std::uint64_t>(p.x) * sample + static_cast<std::uint64_t>(p.y) * row +
           static_cast<std::uint64_t>(p.z) * plane;
  }

  std::uint64_t sample, row, plane, volume;
};

void swap_if_needed(const RawLayout& layout, Box3 box, std::byte* out) {
  if (layout.swap)
    swap_byte_order(out, static_cast<std::size_t>(volume(box.extent())), size_of(layout.info.type));
}

class RawSource final : public VolumeSource {
 public:
  RawSource(RawLayout layout, InputFile file)
      : layout_(std::move(layout)), stride_(layout_), file_(std::move(file)) {}

  const VolumeInfo& info() const override { return layout_.info; }
  bool random_access() const override { return true; }

  void read(Box3 box, std::byte* out) override {
    read_bytes(box, out);
    swap_if_needed(layout_, box, out);
  }

  void will_need(Box3 box) override {
    if (box.empty()) return;
    const std::uint64_t from = layout_.offset + stride_.of(box.lo);
    const std::uint64_t to = layout_.offset + stride_.of(box.hi - Int3{1, 1, 1});
    ::posix_fadvise(file_.fd.get(), static_cast<off_t>(from), static_cast<off_t>(to - from),
                    POSIX_FADV_WILLNEED);
  }

 private:
  void fetch(Int3 from, std::byte* out, std::uint64_t size) const {
    read_at(file_.fd.get(), layout_.info.name, layout_.offset + stride_.of(from), out, size);
  }

  /// As few reads as the box allows: all of it, plane by plane, or row by row.
  void read_bytes(Box3 box, std::byte* out) const {
    if (box.empty()) return;
    const Int3 size = box.extent();
    const auto ny = static_cast<std::uint64_t>(size.y), nz = static_cast<std::uint64_t>(size.z);
    if (size.x == layout_.info.extent.x && size.y == layout_.info.extent.y)
      return fetch(box.lo, out, nz * stride_.plane);
    for (Index z = box.lo.z; z < box.hi.z; ++z) {
      const std::uint64_t width = static_cast<std::uint64_t>(size.x) * stride_.sample;
      if (width == stride_.row)
        fetch({box.lo.x, box.lo.y, z}, out, ny * width);
      else
        read_rows({box.lo.x, box.lo.y, z}, ny, width, out);
      out += ny * width;
    }
  }

  /// `count` pieces of `width` bytes, a row apart. Below a page between them it
  /// is quicker to read the gaps too than to ask for each piece.
  void read_rows(Int3 from, std::uint64_t count, std::uint64_t width, std::byte* out) const {
    constexpr std::uint64_t page = 4096, most = 256 * 1024;
    const bool with_gaps = stride_.row - width <= page;
    const std::uint64_t batch =
        with_gaps ? std::max<std::uint64_t>(1, most / stride_.row) : std::uint64_t{1};
    std::vector<std::byte> rows(batch > 1 ? batch * stride_.row : 0);
    for (std::uint64_t y = 0; y < count; y += batch) {
      const std::uint64_t n = std::min(batch, count - y);
      const Int3 first{from.x, from.y + static_cast<Index>(y), from.z};
      if (batch == 1) {
        fetch(first, out, width);
        out += width;
        continue;
      }
      fetch(first, rows.data(), (n - 1) * stride_.row + width);
      for (std::uint64_t i = 0; i < n; ++i, out += width)
        std::memcpy(out, rows.data() + i * stride_.row, width);
    }
  }

  RawLayout layout_;
  Strides stride_;
  InputFile file_;
};

class StdinSource final : public VolumeSource {
 public:
  explicit StdinSource(RawLayout layout) : layout_(std::move(layout)), stride_(layout_) {
    if (::isatty(STDIN_FILENO))
      throw UsageError("standard input is a terminal; give a file or a pipe");
  }

  const VolumeInfo& info() const override { return layout_.info; }
  bool random_access() const override { return false; }

  void read(Box3 box, std::byte* out) override {
    assert(box.lo.z >= next_plane_ && "planes of a stream come in order, each once");
    skip_to(layout_.offset + static_cast<std::uint64_t>(box.lo.z) * stride_.plane);
    const std::uint64_t size = static_cast<std::uint64_t>(box.extent().z) * stride_.plane;
    if (const std::uint64_t got = take(out, size); got < size) fail_short();
    swap_if_needed(layout_, box, out);
    next_plane_ = box.hi.z;
    if (next_plane_ == layout_.info.extent.z) expect_end();
  }

 private:
  /// Returns when a read would not block (or would fail). The signal that asks
  /// for an end may reach another thread, so this one looks now and then.
  static void wait() {
    constexpr int milliseconds = 100;
    for (int ready = 0; ready <= 0;) {
      if (cancel_requested()) throw Cancelled("interrupted while reading standard input");
      pollfd input{STDIN_FILENO, POLLIN, 0};
      ready = ::poll(&input, 1, milliseconds);
      if (ready < 0 && errno != EINTR) return;
    }
  }

  /// Up to `size` bytes, fewer only at the end.
  std::uint64_t take(std::byte* out, std::uint64_t size) {
    std::uint64_t done = 0;
    while (done < size) {
      const std::uint64_t piece = std::min(size - done, std::uint64_t{1} << 30);
      wait();
      const ssize_t got = ::read(STDIN_FILENO, out + done, piece);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0)
        throw system_error(fmt::format("read at offset {} of", position_), layout_.info.name,
                           errno);
      if (got == 0) break;
      done += static_cast<std::uint64_t>(got);
      position_ += static_cast<std::uint64_t>(got);
    }
    return done;
  }

  void skip_to(std::uint64_t offset) {
    std::array<std::byte, 65536> ignored;
    while (position_ < offset)
      if (take(ignored.data(), std::min<std::uint64_t>(ignored.size(), offset - position_)) == 0)
        fail_short();
  }

  std::uint64_t expected() const { return layout_.offset + stride_.volume; }

  [[noreturn]] void fail_short() const {
    throw UsageError(fmt::format("standard input ended after {} bytes, {} were expected", position_,
                                 expected()));
  }

  void expect_end() {
    // Counted only so far: the rest of an endless stream would never be.
    constexpr std::uint64_t most = 1 << 20;
    std::vector<std::byte> rest(most);
    const std::uint64_t extra = take(rest.data(), most);
    if (extra > 0)
      throw UsageError(fmt::format("standard input goes on after the {} bytes expected: {}{} more",
                                   expected(), extra == most ? "at least " : "", extra));
  }

  RawLayout layout_;
  Strides stride_;
  std::uint64_t position_ = 0;
  Index next_plane_ = 0;
};

}  // namespace

std::unique_ptr<VolumeSource> make_raw_source(RawLayout layout, InputFile file) {
  return std::make_unique<RawSource>(std::move(layout), std::move(file));
}

std::unique_ptr<VolumeSource> make_stdin_source(RawLayout layout) {
  return std::make_unique<StdinSource>(std::move(layout));
}

}  // namespace isobrick
