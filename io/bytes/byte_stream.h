#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace isobrick::inline v0 {

/// Bytes that come in order, from the first to the last, each once: a part of
/// a file, what a compressed file unpacks to, standard input. One thread at a time.
class ByteStream {
 public:
  virtual ~ByteStream() = default;

  /// Copies up to `size` bytes to `out` and returns how many; fewer only at the
  /// end. Throws Error or DamageError naming the file.
  virtual std::size_t read(std::byte* out, std::size_t size) = 0;

  /// What the bytes are, for messages: "'scan.nii.gz'", "standard input".
  virtual std::string name() const = 0;

  /// The most bytes that there can be: refuses headers that promise more before
  /// anything is read. Unlimited where nothing is known.
  virtual std::uint64_t max_bytes() const = 0;

  /// Once read() has met the end: bytes of the file behind it that belong to no compressed data.
  virtual std::uint64_t left_over() const { return 0; }

  /// Bytes of memory that the stream holds.
  virtual std::size_t memory() const { return 0; }

  /// Passes over `size` bytes; throws Error when there are fewer, and Cancelled
  /// when the user ends the program meanwhile.
  void skip(std::uint64_t size);

  /// Fills `out`; throws Error when there are fewer bytes.
  void read_exactly(std::byte* out, std::size_t size);

  /// The next unsigned number of 1, 2, 4 or 8 bytes; `swap`: of the other byte order. Throws Error
  /// when there are fewer bytes.
  std::uint64_t read_unsigned(std::size_t bytes, bool swap);
};

}  // namespace isobrick
