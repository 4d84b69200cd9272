// Preloaded into the program: the process is killed right before call number ISOBRICK_KILL_AT,
// from 0, of those that rename or remove something. With ISOBRICK_NO_EXCHANGE the file system
// cannot let two names change places.

#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace {

void count_call() {
  static std::atomic<long> left = [] {
    const char* at = std::getenv("ISOBRICK_KILL_AT");
    return at == nullptr ? -1 : std::atol(at);
  }();
  if (left.fetch_sub(1) == 0) ::kill(::getpid(), SIGKILL);
}

template <class Function>
Function* original(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int rename(const char* from, const char* to) noexcept {
  count_call();
  return original<int(const char*, const char*)>("rename")(from, to);
}

int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  count_call();
  return original<int(int, const char*, int, const char*)>("renameat")(from_folder, from, to_folder,
                                                                       to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to,
              unsigned flags) noexcept {
  if (flags == RENAME_EXCHANGE && std::getenv("ISOBRICK_NO_EXCHANGE") != nullptr) {
    errno = EINVAL;
    return -1;
  }
  count_call();
  return original<int(int, const char*, int, const char*, unsigned)>("renameat2")(
      from_folder, from, to_folder, to, flags);
}

int unlink(const char* path) noexcept {
  count_call();
  return original<int(const char*)>("unlink")(path);
}

int unlinkat(int folder, const char* path, int flags) noexcept {
  count_call();
  return original<int(int, const char*, int)>("unlinkat")(folder, path, flags);
}

int remove(const char* path) noexcept {
  count_call();
  return original<int(const char*)>("remove")(path);
}

int rmdir(const char* path) noexcept {
  count_call();
  return original<int(const char*)>("rmdir")(path);
}

}  // extern "C"
