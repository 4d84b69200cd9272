#include "filters/scratch_pages.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

ScratchPages::ScratchPages(ScratchPlace place, std::size_t page_bytes, std::size_t max_resident)
    : place_(std::move(place)),
      page_bytes_(page_bytes),
      max_resident_(std::clamp<std::size_t>(max_resident, 1, kAbsent)) {}

void ScratchPages::write_back(std::uint32_t frame) {
  if (!file_) file_ = open_scratch_file(place_.beside);
  const std::uint64_t page = pages_of_[frame];
  file_.write_at(page * page_bytes_, {buffer_.data() + frame * page_bytes_, page_bytes_});
  file_pages_ = std::max(file_pages_, page + 1);
}

std::uint32_t ScratchPages::take_frame() {
  if (pages_of_.size() < max_resident_) {
    const std::size_t frames = pages_of_.size() + 1;
    if (buffer_.capacity() < frames * page_bytes_)
      buffer_.reserve(std::min(max_resident_, 2 * frames) * page_bytes_);
    buffer_.resize(frames * page_bytes_);
    pages_of_.push_back(0);
    states_.push_back(0);
    return static_cast<std::uint32_t>(frames - 1);
  }
  // A page goes if it was not used since the hand passed it.
  while ((states_[hand_] & kUsed) != 0) {
    states_[hand_] &= static_cast<std::uint8_t>(~kUsed);
    hand_ = hand_ + 1 == pages_of_.size() ? 0 : hand_ + 1;
  }
  const std::uint32_t frame = hand_;
  if ((states_[frame] & kChanged) != 0) write_back(frame);
  frames_of_[static_cast<std::size_t>(pages_of_[frame])] = kAbsent;
  hand_ = hand_ + 1 == pages_of_.size() ? 0 : hand_ + 1;
  return frame;
}

std::byte* ScratchPages::load(std::uint64_t page) {
  const std::uint32_t frame = take_frame();
  std::byte* bytes = buffer_.data() + frame * page_bytes_;
  if (page < file_pages_)
    file_.read_at(page * page_bytes_, {bytes, page_bytes_});
  else
    std::memset(bytes, 0, page_bytes_);
  pages_of_[frame] = page;
  states_[frame] = kUsed;
  frames_of_[static_cast<std::size_t>(page)] = frame;
  current_ = frame;
  return bytes;
}

void ScratchPages::clear() {
  pages_of_.clear();
  states_.clear();
  frames_of_.clear();
  buffer_.clear();
  file_ = File();  // what it holds must not come back
  file_pages_ = 0;
  hand_ = current_ = 0;
}

void ScratchPages::release() {
  clear();
  buffer_ = PodBuffer<std::byte>();
  frames_of_ = {};
}

}  // namespace isobrick
