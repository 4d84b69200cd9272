#include "io/bytes/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <new>
#include <stdexcept>

#include <isobrick/error.h>
#include "io/bytes/leftovers.h"
#include "io/bytes/rename.h"
#include "io/bytes/url.h"

namespace isobrick::inline v0 {
namespace {

FileWriter open_standard_output() {
  UniqueFd fd = duplicate(STDOUT_FILENO);
  if (fd.get() < 0) throw system_error("write to", "standard output", errno);
  return FileWriter({std::move(fd), "standard output"});
}

}  // namespace

FileWriter::FileWriter(File file, std::size_t memory) : file_(std::move(file)) {
  make_buffer(std::max(memory, kBuffer));
}

void FileWriter::make_buffer(std::size_t capacity) {
  // The first touch of a small page takes as long as to write it.
  constexpr std::size_t large_page = std::size_t{2} << 20;
  const bool large = capacity >= large_page;
  const std::size_t align = large ? large_page : 64;
  const std::size_t bytes = (capacity + align - 1) / align * align;
  std::unique_ptr<std::byte, BufferDeleter> buffer(
      static_cast<std::byte*>(std::aligned_alloc(align, bytes)));
  if (!buffer) throw std::bad_alloc();
  if (large) (void)::madvise(buffer.get(), bytes, MADV_HUGEPAGE);
  buffer_ = std::move(buffer);
  capacity_ = capacity;
}

std::byte* FileWriter::reserve(std::size_t size) {
  if (used_ + size > capacity_) flush();
  if (size > capacity_) throw std::length_error("more bytes are reserved than a buffer has");
  return buffer_.get() + used_;
}

void FileWriter::append(std::span<const std::byte> bytes) {
  if (used_ + bytes.size() > capacity_) flush();
  if (bytes.size() > capacity_) {
    write_all(bytes.data(), bytes.size());
  } else if (!bytes.empty()) {
    std::memcpy(reserve(bytes.size()), bytes.data(), bytes.size());
    commit(bytes.size());
  }
}

void FileWriter::flush() {
  write_all(buffer_.get(), std::exchange(used_, 0));
  // What did not fit in memory goes into the file as it comes.
  if (capacity_ > kBuffer) make_buffer(kBuffer);
}

void FileWriter::finish() {
  flush();
  // A network's file system may store only now, and report a failure only to close().
  const int copy = duplicate(file_.fd()).release();
  if (copy < 0 || ::close(copy) != 0) fail(errno);
  buffer_.reset();
  capacity_ = 0;
}

void FileWriter::release() {
  buffer_.reset();
  capacity_ = used_ = 0;
  written_ = 0;
}

void FileWriter::write_all(const std::byte* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t put = ::write(file_.fd(), bytes, std::min(size, std::size_t{1} << 30));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) fail(errno);
    written_ += static_cast<std::uint64_t>(put);
    bytes += put;
    size -= static_cast<std::size_t>(put);
  }
}

void FileWriter::fail(int errno_value) const {
  throw system_error(fmt::format("write after {} bytes to", written_), file_.path().string(),
                     errno_value);
}

void FileWriter::append_range(FileWriter& other, std::uint64_t offset, std::uint64_t size) {
  flush();
  if (offset >= other.written_)
    return write_all(other.buffer_.get() + (offset - other.written_), size);
  other.flush();
  auto from = static_cast<off_t>(offset);
  const auto end = static_cast<off_t>(offset + size);
  while (from < end) {
    const ssize_t moved =
        ::copy_file_range(other.file_.fd(), &from, file_.fd(), nullptr,
                          std::min<std::size_t>(static_cast<std::size_t>(end - from), 1u << 30), 0);
    if (moved > 0) {
      written_ += static_cast<std::uint64_t>(moved);
      continue;
    }
    if (moved < 0 && errno == EINTR) continue;
    if (moved < 0 && (errno == ENOSPC || errno == EFBIG || errno == EIO || errno == EDQUOT))
      fail(errno);
    break;  // not on this file system
  }
  while (from < end) {
    const std::size_t piece = std::min(static_cast<std::size_t>(end - from), kBuffer);
    other.file_.read_at(static_cast<std::uint64_t>(from), {buffer_.get(), piece});
    write_all(buffer_.get(), piece);
    from += static_cast<off_t>(piece);
  }
}

void FileWriter::patch(std::uint64_t offset, std::string_view bytes) {
  flush();
  file_.write_at(offset, std::as_bytes(std::span(bytes)));
}

void FileWriter::read_back(std::uint64_t offset, std::span<std::byte> bytes) {
  if (offset >= written_ && offset - written_ + bytes.size() <= used_) {
    if (!bytes.empty())
      std::memcpy(bytes.data(), buffer_.get() + (offset - written_), bytes.size());
    return;
  }
  flush();
  file_.read_at(offset, bytes);
}

void FileWriter::restart() {
  used_ = 0;
  written_ = 0;
  if (::ftruncate(file_.fd(), 0) != 0 || ::lseek(file_.fd(), 0, SEEK_SET) != 0) fail(errno);
}

File FileWriter::share() const { return file_.share(); }

void check_output(const std::string& path, bool force) {
  if (path.empty()) throw UsageError("the output has no name");
  if (path == kStandardOutput) return;
  if (is_url(path)) throw UsageError(fmt::format("'{}': nothing can be written to a URL", path));
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;  // whatever is wrong shows when it is created
  const bool is_link = S_ISLNK(status.st_mode);
  if (is_link && ::stat(path.c_str(), &status) != 0)
    throw UsageError(fmt::format("'{}' is a symbolic link to nothing; remove it", path));
  const char* link = is_link ? " a symbolic link to" : "";
  if (S_ISDIR(status.st_mode)) throw UsageError(fmt::format("'{}' is{} a directory", path, link));
  // Renaming over a device or a pipe, or over a link to one, would replace it by a file.
  if (!S_ISREG(status.st_mode))
    throw UsageError(fmt::format("'{}' is{} {} regular file", path, link,
                                 is_link ? "something that is no" : "not a"));
  if (!force) throw UsageError(fmt::format("'{}' exists already; add --force to replace it", path));
}

OutputFile::OutputFile(std::string path, bool force, Streaming streaming)
    : path_(std::move(path)),
      force_(force),
      waits_(path_ == kStandardOutput && streaming == Streaming::when_complete),
      writer_([this] {
        if (waits_) return open_scratch_beside(path_);
        if (path_ == kStandardOutput) return open_standard_output();
        // First: what a killed process left goes also where the output stays as it is.
        if (!path_.empty()) remove_leftovers(path_);
        check_output(path_, force_);
        Temporary temporary = create_temporary_file(path_);
        temporary_ = std::move(temporary.path);
        return FileWriter({std::move(temporary.fd), path_});
      }()) {}

OutputFile::~OutputFile() {
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void OutputFile::copy_to_standard_output() {
  // Only a look: a reader that does not take what is written must not hold up other outputs.
  { const Publication turn; }
  FileWriter out = open_standard_output();
  out.append_file(writer_);
  out.finish();
}

void OutputFile::publish() {
  if (waits_) copy_to_standard_output();
  writer_.finish();
  const Publication turn;
  if (path_ == kStandardOutput) return;
  if (force_) check_output(path_, true);  // something else may have appeared
  int failure = 0;
  if (!force_)
    failure = rename_no_replace(temporary_, path_);
  else if (::rename(temporary_.c_str(), path_.c_str()) != 0)
    failure = errno;
  if (failure == EEXIST) check_output(path_, force_);
  if (failure != 0) throw system_error("rename the finished file to", path_, failure);
  temporary_.clear();
}

void write_new_file(const std::string& path, std::string_view bytes) {
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error("create", path, errno);
  FileWriter writer({std::move(fd), path});
  writer.append(bytes);
  writer.finish();
}

File open_scratch_file(const std::string& path) {
  const bool beside = path != kStandardOutput;
  const auto named = beside ? std::filesystem::path(path) : temporary_folder();
  Temporary temporary = create_temporary_file((beside ? named : named / "isobrick").string());
  ::unlink(temporary.path.c_str());
  return {std::move(temporary.fd), named};
}

FileWriter open_scratch_beside(const std::string& path, std::size_t memory) {
  return FileWriter(open_scratch_file(path), memory);
}

}  // namespace isobrick
