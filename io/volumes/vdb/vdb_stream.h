#pragma once

// Bytes of a file as the streams that OpenVDB reads from. Only for the sources that see
// OpenVDB anyway.

#include <cstddef>
#include <cstdint>
#include <span>
#include <streambuf>
#include <string>
#include <vector>

#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// A file to be read forward with many small steps: at every node OpenVDB queries the position and
/// skips some bytes, which costs no system call here. Places behind the end
/// cannot be sought.
class VdbFileBuffer final : public std::streambuf {
 public:
  /// Throws what open_input throws.
  explicit VdbFileBuffer(const std::string& path);

 protected:
  int_type underflow() override;
  pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override;
  pos_type seekpos(pos_type at, std::ios_base::openmode which) override;

 private:
  File file_;
  std::uint64_t size_;  ///< of the file
  std::vector<char> buffer_;
  std::uint64_t end_ = 0;  ///< of what is in the buffer
};

/// Bytes in memory.
class VdbMemoryBuffer final : public std::streambuf {
 public:
  /// `bytes` must stay until the next call.
  void assign(std::span<char> bytes) {
    setg(bytes.data(), bytes.data(), bytes.data() + bytes.size());
  }
};

}  // namespace isobrick
