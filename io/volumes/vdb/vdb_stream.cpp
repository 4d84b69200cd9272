#include "io/volumes/vdb/vdb_stream.h"

#include <algorithm>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16;

}  // namespace

VdbFileBuffer::VdbFileBuffer(const std::string& path)
    : file_(open_input(path)), size_(file_.size()), buffer_(kBufferBytes) {}

VdbFileBuffer::int_type VdbFileBuffer::underflow() {
  const std::size_t size = std::min<std::uint64_t>(buffer_.size(), size_ - end_);
  if (size == 0) return traits_type::eof();
  file_.read_at(end_, std::as_writable_bytes(std::span(buffer_).first(size)));
  end_ += size;
  setg(buffer_.data(), buffer_.data(), buffer_.data() + size);
  return traits_type::to_int_type(buffer_.front());
}

VdbFileBuffer::pos_type VdbFileBuffer::seekoff(off_type offset, std::ios_base::seekdir from,
                                               std::ios_base::openmode which) {
  if (from == std::ios_base::end) return seekpos(static_cast<off_type>(size_) + offset, which);
  if (from == std::ios_base::beg) return seekpos(offset, which);
  const auto at = static_cast<off_type>(end_) - (egptr() - gptr());
  off_type target;
  if (__builtin_add_overflow(at, offset, &target)) return pos_type(off_type{-1});
  return seekpos(target, which);
}

VdbFileBuffer::pos_type VdbFileBuffer::seekpos(pos_type to, std::ios_base::openmode) {
  const off_type at = to;
  if (at < 0 || static_cast<std::uint64_t>(at) > size_) return pos_type(off_type{-1});
  const auto first = static_cast<off_type>(end_) - (egptr() - eback());
  if (at >= first && static_cast<std::uint64_t>(at) <= end_) {
    setg(eback(), eback() + (at - first), egptr());
  } else {
    setg(buffer_.data(), buffer_.data(), buffer_.data());
    end_ = static_cast<std::uint64_t>(at);
  }
  return to;
}

}  // namespace isobrick
