// Preloaded into the program: regular files take ISOBRICK_FAULT_AFTER bytes in all, then every
// write fails with the error number ISOBRICK_FAULT_ERRNO. A negative number of bytes lets writes
// succeed, and closing a file that is open for writing fail. With ISOBRICK_FAULT_SIGNAL nothing
// fails, but the process gets that signal with the write that goes beyond those bytes. With
// ISOBRICK_FAULT_INTERRUPTS every other write and read at an offset is interrupted (EINTR).

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace {

struct Fault {
  std::atomic<long long> left{0};
  int number = 0;  ///< 0: none
  int signal = 0;  ///< 0: none
  bool at_close = false;
  bool interrupts = false;
  std::atomic<unsigned> calls{0};

  Fault() {
    interrupts = std::getenv("ISOBRICK_FAULT_INTERRUPTS") != nullptr;
    const char* after = std::getenv("ISOBRICK_FAULT_AFTER");
    const char* text = std::getenv("ISOBRICK_FAULT_ERRNO");
    if (after == nullptr || text == nullptr) return;
    left = std::atoll(after);
    number = std::atoi(text);
    if (const char* sent = std::getenv("ISOBRICK_FAULT_SIGNAL")) signal = std::atoi(sent);
    at_close = left < 0;
  }
};

Fault& fault() {
  static Fault instance;
  return instance;
}

bool is_output(int fd) {
  struct stat status {};
  return fault().number != 0 && ::fstat(fd, &status) == 0 && S_ISREG(status.st_mode) &&
         (::fcntl(fd, F_GETFL) & O_ACCMODE) != O_RDONLY;
}

/// Whether a call is interrupted, which sets errno.
bool interrupted() {
  if (!fault().interrupts || fault().calls++ % 2 != 0) return false;
  errno = EINTR;
  return true;
}

/// How many of `size` bytes the disk takes; -1 and errno when it is full.
ssize_t granted(int fd, std::size_t size) {
  if (size > 0 && interrupted()) return -1;
  const auto wanted = static_cast<long long>(size);
  if (size == 0 || fault().at_close || !is_output(fd)) return wanted;
  const long long before = fault().left.fetch_sub(wanted);
  if (fault().signal != 0) {
    if (before >= 0 && before < wanted) ::kill(::getpid(), fault().signal);
    return wanted;
  }
  if (before > 0) return std::min(before, wanted);
  errno = fault().number;
  return -1;
}

template <class F>
F* next(const char* name, F*) {
  return reinterpret_cast<F*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* bytes, size_t size) {
  const ssize_t n = granted(fd, size);
  return n < 0 ? n : next("write", &write)(fd, bytes, static_cast<size_t>(n));
}

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  const ssize_t n = granted(fd, size);
  return n < 0 ? n : next("pwrite", &pwrite)(fd, bytes, static_cast<size_t>(n), offset);
}

ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  return interrupted() ? -1 : next("pread", &pread)(fd, bytes, size, offset);
}

ssize_t pread64(int fd, void* bytes, size_t size, off64_t offset) {
  return pread(fd, bytes, size, offset);
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) {
  return pwrite(fd, bytes, size, offset);
}

ssize_t writev(int fd, const struct iovec* pieces, int count) {
  std::size_t size = 0;
  for (int i = 0; i < count; ++i) size += pieces[i].iov_len;
  const ssize_t n = granted(fd, size);
  if (n < 0) return n;
  if (static_cast<std::size_t>(n) == size) return next("writev", &writev)(fd, pieces, count);
  return next("write", &write)(fd, pieces[0].iov_base,
                               std::min(pieces[0].iov_len, static_cast<std::size_t>(n)));
}

ssize_t copy_file_range(int in, off64_t* in_at, int out, off64_t* out_at, size_t size,
                        unsigned flags) {
  const ssize_t n = granted(out, size);
  return n < 0 ? n
               : next("copy_file_range", &copy_file_range)(in, in_at, out, out_at,
                                                           static_cast<size_t>(n), flags);
}

int close(int fd) {
  const bool fails = fault().at_close && is_output(fd);
  const int result = next("close", &close)(fd);
  if (!fails || result != 0) return result;
  errno = fault().number;
  return -1;
}

}  // extern "C"
