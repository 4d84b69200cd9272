#pragma once

#include <cstdint>
#include <ostream>
#include <streambuf>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// A standard stream over a FileWriter, for a library that writes to one. It may go back and
/// replace bytes. Every failure is thrown as the Error that the FileWriter throws, at once.
class WriterStream final : public std::ostream {
 public:
  /// `file` must outlive it.
  explicit WriterStream(FileWriter& file);

 private:
  class Buffer final : public std::streambuf {
   public:
    explicit Buffer(FileWriter& file) : file_(file), at_(file.size()) {}

   private:
    int_type overflow(int_type c) override;
    std::streamsize xsputn(const char* bytes, std::streamsize size) override;
    pos_type seekoff(off_type offset, std::ios_base::seekdir from,
                     std::ios_base::openmode) override;
    pos_type seekpos(pos_type place, std::ios_base::openmode) override;

    FileWriter& file_;
    std::uint64_t at_;  ///< where the next byte goes, at most file_.size()
  };

  Buffer buffer_;
};

}  // namespace isobrick
