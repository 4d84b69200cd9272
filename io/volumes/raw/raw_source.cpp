#include "io/volumes/raw/raw_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

class RawSource final : public VolumeSource {
 public:
  RawSource(SampleLayout layout, File file)
      : layout_(std::move(layout)),
        sample_(size_of(layout_.info.type)),
        row_(sample_ * static_cast<std::uint64_t>(layout_.info.extent.x)),
        file_(std::move(file)) {}

  const VolumeInfo& info() const override { return layout_.info; }
  bool random_access() const override { return true; }
  std::vector<std::string> notes() const override { return layout_.notes; }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    if (layout_.dense() && box.extent().x != layout_.info.extent.x) return read_parts(box, out);
    read_samples(
        layout_, box,
        [&](std::uint64_t offset, std::byte* to, std::size_t size) { fetch(offset, to, size); },
        out);
  }

  void will_need(Box3 box) override {
    if (box.empty()) return;
    const std::uint64_t from = layout_.offset_of(box.lo);
    const std::uint64_t to = layout_.offset_of(box.hi - Int3{1, 1, 1}) + sample_;
    file_.will_need(from, to - from);
  }

 private:
  void fetch(std::uint64_t offset, std::byte* out, std::uint64_t size) const {
    file_.read_at(offset, {out, static_cast<std::size_t>(size)});
  }

  /// Parts of rows of a dense volume.
  void read_parts(Box3 box, std::byte* out) const {
    const Int3 size = box.extent();
    const auto ny = static_cast<std::uint64_t>(size.y);
    const std::uint64_t width = static_cast<std::uint64_t>(size.x) * sample_;
    std::byte* to = out;
    for (Index z = box.lo.z; z < box.hi.z; ++z, to += ny * width)
      read_rows({box.lo.x, box.lo.y, z}, ny, width, to);
    if (layout_.swap) swap_byte_order(out, static_cast<std::size_t>(volume(size)), sample_);
  }

  /// `count` pieces of `width` bytes, a row apart. Below a page between them it
  /// is faster to read the gaps, too, than to read each piece.
  void read_rows(Int3 from, std::uint64_t count, std::uint64_t width, std::byte* out) const {
    constexpr std::uint64_t page = 4096, most = 256 * 1024;
    const bool with_gaps = row_ - width <= page;
    const std::uint64_t batch = with_gaps ? std::max<std::uint64_t>(1, most / row_) : 1;
    std::vector<std::byte> rows(batch > 1 ? batch * row_ : 0);
    for (std::uint64_t y = 0; y < count; y += batch) {
      const std::uint64_t n = std::min(batch, count - y);
      const std::uint64_t first =
          layout_.offset_of({from.x, from.y + static_cast<Index>(y), from.z});
      if (batch == 1) {
        fetch(first, out, width);
        out += width;
        continue;
      }
      fetch(first, rows.data(), (n - 1) * row_ + width);
      for (std::uint64_t i = 0; i < n; ++i, out += width)
        std::memcpy(out, rows.data() + i * row_, width);
    }
  }

  SampleLayout layout_;
  std::size_t sample_;
  std::uint64_t row_;
  File file_;
};

}  // namespace

std::unique_ptr<VolumeSource> make_raw_source(SampleLayout layout, File file) {
  return std::make_unique<RawSource>(std::move(layout), std::move(file));
}

void check_header_promise(const SampleLayout& layout, const File& file) {
  const std::uint64_t size = file.size();
  if (size < layout.end())
    throw UsageError(fmt::format("'{}' has {} bytes, but its header{} promises samples up to {}",
                                 file.path().string(), size, layout.header_in_message(),
                                 layout.end()));
}

}  // namespace isobrick
