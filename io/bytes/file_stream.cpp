#include "io/bytes/file_stream.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "core/cancel.h"

namespace isobrick::inline v0 {
namespace {

class FileStream final : public ByteStream {
 public:
  FileStream(File file, std::uint64_t begin)
      : file_(std::move(file)),
        end_(file_.size()),
        begin_(std::min(begin, end_)),
        position_(begin_) {
    ::posix_fadvise(file_.fd(), static_cast<off_t>(begin_), static_cast<off_t>(end_ - begin_),
                    POSIX_FADV_SEQUENTIAL);
  }

  std::size_t read(std::byte* out, std::size_t size) override {
    size = static_cast<std::size_t>(std::min<std::uint64_t>(size, end_ - position_));
    file_.read_at(position_, {out, size});
    position_ += size;
    return size;
  }

  std::string name() const override { return quoted(file_.path()); }
  std::uint64_t max_bytes() const override { return end_ - begin_; }

 private:
  File file_;
  std::uint64_t end_, begin_, position_;
};

class StdinStream final : public ByteStream {
 public:
  StdinStream() {
    if (::isatty(STDIN_FILENO))
      throw UsageError("standard input is a terminal; give a file or a pipe");
  }

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size) {
      const std::size_t piece = std::min(size - done, std::size_t{1} << 30);
      wait();
      const ssize_t got = ::read(STDIN_FILENO, out + done, piece);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0)
        throw system_error(fmt::format("read at offset {} of", position_), name(), errno);
      if (got == 0) break;
      done += static_cast<std::size_t>(got);
      position_ += static_cast<std::uint64_t>(got);
    }
    return done;
  }

  std::string name() const override { return "standard input"; }
  std::uint64_t max_bytes() const override { return std::numeric_limits<std::uint64_t>::max(); }

 private:
  /// Returns when a read would not block (or would fail). The signal that
  /// ends the program may reach another thread, so this one polls.
  static void wait() {
    constexpr int milliseconds = 100;
    for (int ready = 0; ready <= 0;) {
      if (cancel_requested()) throw Cancelled("interrupted while reading standard input");
      pollfd input{STDIN_FILENO, POLLIN, 0};
      ready = ::poll(&input, 1, milliseconds);
      if (ready < 0 && errno != EINTR) return;
    }
  }

  std::uint64_t position_ = 0;
};

}  // namespace

std::unique_ptr<ByteStream> make_file_stream(File file, std::uint64_t begin) {
  return std::make_unique<FileStream>(std::move(file), begin);
}

std::unique_ptr<ByteStream> make_stdin_stream() { return std::make_unique<StdinStream>(); }

}  // namespace isobrick
