#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// Appends to a file through a large buffer.
class FileWriter {
 public:
  /// The first `memory` bytes, at least kBuffer, stay in memory until there are more or a function
  /// needs them in the file. After that the buffer has kBuffer bytes.
  explicit FileWriter(File file, std::size_t memory = kBuffer);

  /// Room for `size` <= kBuffer bytes, to be filled in place and then committed.
  std::byte* reserve(std::size_t size);
  void commit(std::size_t size) { used_ += size; }

  void append(std::span<const std::byte> bytes);
  void append(std::string_view text) { append(std::as_bytes(std::span(text))); }
  /// Appends all that `other` has taken so far, moved by the kernel where it can.
  void append_file(FileWriter& other) { append_range(other, 0, other.size()); }
  /// Appends `size` bytes of `other` from `offset` on; they are there already.
  void append_range(FileWriter& other, std::uint64_t offset, std::uint64_t size);

  /// Replaces bytes that were appended before.
  void patch(std::uint64_t offset, std::string_view bytes);
  /// Reads back bytes that were appended before; the file is open for reading, too.
  void read_back(std::uint64_t offset, std::span<std::byte> bytes);
  /// Forgets everything: the next byte is the first.
  void restart();
  void flush();
  /// Flushes, and throws what file systems report only when a file is closed. Nothing follows: the
  /// buffer is freed.
  void finish();
  /// Forgets a file that is not needed any more, and frees the buffer. Nothing follows.
  void release();

  /// The same file once more, to be read or written at offsets. What is still in the buffer is not
  /// in it: flush() first. Appending and writing at offsets do not mix.
  File share() const;

  /// Bytes appended so far.
  std::uint64_t size() const { return written_ + used_; }

  static constexpr std::size_t kBuffer = std::size_t{1} << 20;

 private:
  void make_buffer(std::size_t capacity);
  void write_all(const std::byte* bytes, std::size_t size);
  [[noreturn]] void fail(int errno_value) const;

  struct BufferDeleter {
    void operator()(std::byte* buffer) const { std::free(buffer); }
  };

  File file_;
  std::size_t capacity_ = 0;  ///< of the buffer; kBuffer when something has been written
  std::unique_ptr<std::byte, BufferDeleter> buffer_;
  std::size_t used_ = 0;
  std::uint64_t written_ = 0;
};

/// The name of an output that goes to standard output. There is nothing to replace then.
inline constexpr std::string_view kStandardOutput = "-";

/// When an output named kStandardOutput is written.
enum class Streaming : std::uint8_t {
  as_written,     ///< at once; nothing can be read back or patched
  when_complete,  ///< by publish(), out of a nameless file in the folder of temporary files
};

/// Throws UsageError when `path` exists and `force` is not set, and when it is neither a regular
/// file nor a link to one.
void check_output(const std::string& path, bool force);

/// A file that appears under its name only when it is whole: it is written
/// beside it under a temporary name, which the destructor removes unless
/// `publish` was called; what a killed process left of the same output is removed first.
///
/// Nothing is synced: a mesh or a picture lost in a power cut is made again,
/// and a sync would cost more than the writing.
class OutputFile {
 public:
  /// Throws as check_output() does, and Error when its folder cannot be written to.
  OutputFile(std::string path, bool force, Streaming streaming = Streaming::as_written);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  FileWriter& writer() { return writer_; }
  const FileWriter& writer() const { return writer_; }
  const std::string& path() const { return path_; }
  /// Where it is until it is published, for a reader that checks it.
  const std::string& temporary_path() const { return temporary_; }

  /// Flushes and renames. Replaces a file that appeared in the meantime only with `force`. Copies
  /// to standard output what waits for that.
  /// Throws Cancelled when an end was requested.
  void publish();

 private:
  void copy_to_standard_output();

  std::string path_;
  bool force_;
  bool waits_ = false;     ///< for publish() to copy it to standard output
  std::string temporary_;  ///< empty once published
  FileWriter writer_;
};

/// Writes a file that is not there yet, in a folder that has no final name before all of it is
/// whole. Throws Error.
void write_new_file(const std::string& path, std::string_view bytes);

/// A nameless file in the folder of `path`, for standard output in that of temporary files: gone
/// when it is closed, whatever happens. Messages name `path`, or that folder.
File open_scratch_file(const std::string& path);
/// The same to append to; `memory` as FileWriter.
FileWriter open_scratch_beside(const std::string& path, std::size_t memory = FileWriter::kBuffer);

}  // namespace isobrick
