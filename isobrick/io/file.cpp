#include "isobrick/io/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "isobrick/core/error.h"

namespace isobrick {

UniqueFd::~UniqueFd() {
  if (fd_ >= 0) ::close(fd_);
}

InputFile open_input(const std::string& path) {
  // Non-blocking, so that a pipe without a writer is refused below instead of waited for.
  InputFile file{UniqueFd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)), 0};
  if (file.fd.get() < 0) throw system_error("open", path, errno);
  struct stat status {};
  if (::fstat(file.fd.get(), &status) != 0) throw system_error("examine", path, errno);
  if (S_ISDIR(status.st_mode)) throw UsageError(fmt::format("'{}' is a directory", path));
  if (!S_ISREG(status.st_mode))
    throw UsageError(fmt::format(
        "'{}' is not a regular file (a pipe can be given as standard input, '-')", path));
  file.size = static_cast<std::uint64_t>(status.st_size);
  return file;
}

void read_at(int fd, const std::string& path, std::uint64_t offset, std::byte* out,
             std::size_t size) {
  while (size > 0) {
    // Linux moves at most 2 GiB a call.
    const std::size_t piece = std::min(size, std::size_t{1} << 30);
    const ssize_t got = ::pread(fd, out, piece, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      throw system_error(fmt::format("read {} bytes at offset {} of", size, offset), path, errno);
    if (got == 0)
      throw Error(fmt::format("'{}' ends at offset {}, {} bytes too early", path, offset, size));
    offset += static_cast<std::uint64_t>(got);
    out += got;
    size -= static_cast<std::size_t>(got);
  }
}

}  // namespace isobrick
