#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/pod_buffer.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// Where scratch arrays keep what memory does not hold.
struct ScratchPlace {
  /// The file beside which scratch files lie; "-": in the folder of temporary files.
  std::string beside = "-";
  /// Bytes of a page. Tests take small ones.
  std::size_t page_bytes = std::size_t{64} << 10;
};

/// The pages of a scratch array: bytes in a nameless file, of which a fixed number of pages is
/// resident. A page that has to go is written back only if it changed. Pages that nobody wrote hold
/// zeros. The file is made when the first page has to go, so small arrays need no disk.
///
/// Beside the resident pages there are four bytes a page: 1/16384 of the array with pages of 64
/// KiB.
class ScratchPages {
 public:
  /// `max_resident` >= 1 pages of `page_bytes` each.
  ScratchPages(ScratchPlace place, std::size_t page_bytes, std::size_t max_resident);

  /// Makes room for pages [0, count) where there is none yet.
  void require(std::uint64_t count) {
    if (count > frames_of_.size()) frames_of_.resize(static_cast<std::size_t>(count), kAbsent);
  }
  std::uint64_t pages() const { return frames_of_.size(); }

  /// A page, below pages(), that is resident until the next call for another one.
  std::byte* get(std::uint64_t page) {
    const std::uint32_t frame = frames_of_[static_cast<std::size_t>(page)];
    if (frame == kAbsent) [[unlikely]]
      return load(page);
    states_[frame] |= kUsed;
    current_ = frame;
    return buffer_.data() + frame * page_bytes_;
  }
  /// The page of the last call changed.
  void mark_changed() { states_[current_] |= kChanged; }

  /// Forgets all pages and frees the file, and keeps the memory.
  void clear();
  /// Frees memory and file. No page is there any more.
  void release();

  std::size_t resident() const { return pages_of_.size(); }
  std::size_t max_resident() const { return max_resident_; }
  /// Bytes of the file.
  std::uint64_t file_bytes() const { return file_pages_ * page_bytes_; }

 private:
  static constexpr std::uint32_t kAbsent = ~std::uint32_t{0};
  static constexpr std::uint8_t kUsed = 1, kChanged = 2;

  std::byte* load(std::uint64_t page);
  std::uint32_t take_frame();
  void write_back(std::uint32_t frame);

  ScratchPlace place_;
  std::size_t page_bytes_, max_resident_;
  File file_;
  std::uint64_t file_pages_ = 0;          ///< that the file holds; those behind are zeros
  PodBuffer<std::byte> buffer_;           ///< the frames
  std::vector<std::uint64_t> pages_of_;   ///< by frame
  std::vector<std::uint8_t> states_;      ///< by frame
  std::vector<std::uint32_t> frames_of_;  ///< by page
  std::uint32_t hand_ = 0;                ///< of the clock that chooses which page goes
  std::uint32_t current_ = 0;
};

}  // namespace isobrick
