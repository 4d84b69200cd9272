#include "io/bytes/writer_stream.h"

#include <algorithm>
#include <string_view>

namespace isobrick::inline v0 {

WriterStream::WriterStream(FileWriter& file) : std::ostream(nullptr), buffer_(file) {
  rdbuf(&buffer_);
  // With these, a stream rethrows what its buffer throws instead of noting a bad state.
  exceptions(std::ios::failbit | std::ios::badbit);
}

std::streambuf::int_type WriterStream::Buffer::overflow(int_type c) {
  using Traits = std::char_traits<char>;
  if (Traits::eq_int_type(c, Traits::eof())) return Traits::not_eof(c);
  const char byte = Traits::to_char_type(c);
  xsputn(&byte, 1);
  return c;
}

std::streamsize WriterStream::Buffer::xsputn(const char* bytes, std::streamsize size) {
  std::string_view text(bytes, static_cast<std::size_t>(size));
  if (at_ < file_.size()) {
    const std::uint64_t behind = file_.size() - at_;
    const std::string_view old = text.substr(0, behind);
    file_.patch(at_, old);
    text.remove_prefix(old.size());
  }
  file_.append(text);
  at_ += static_cast<std::uint64_t>(size);
  return size;
}

std::streambuf::pos_type WriterStream::Buffer::seekoff(off_type offset, std::ios_base::seekdir from,
                                                       std::ios_base::openmode mode) {
  const std::uint64_t base = from == std::ios::beg ? 0 : from == std::ios::cur ? at_ : file_.size();
  return seekpos(static_cast<off_type>(base) + offset, mode);
}

std::streambuf::pos_type WriterStream::Buffer::seekpos(pos_type place, std::ios_base::openmode) {
  const off_type to = place;
  if (to < 0 || static_cast<std::uint64_t>(to) > file_.size()) return pos_type(off_type(-1));
  at_ = static_cast<std::uint64_t>(to);
  return place;
}

}  // namespace isobrick
