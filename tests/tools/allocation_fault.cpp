// Preloaded into the program: once it has read its command line, which is when it first handles a
// signal, allocation ISOBRICK_FAULT_AT and ISOBRICK_FAULT_LENGTH − 1 after it get no memory.

#include <dlfcn.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>

// The C library's own, which need no dlsym(): that allocates.
extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);
void* __libc_memalign(size_t alignment, size_t size);
}

namespace {

std::atomic<long> g_count{0};
std::atomic<bool> g_counts{false};

long number_of(const char* name) {
  const char* text = std::getenv(name);
  return text ? std::atol(text) : 0;
}

bool fails() {
  if (!g_counts) return false;
  static const long at = number_of("ISOBRICK_FAULT_AT");
  static const long length = number_of("ISOBRICK_FAULT_LENGTH");
  const long i = g_count++;
  if (i < at || i >= at + length) return false;
  errno = ENOMEM;
  return true;
}

}  // namespace

extern "C" {

void* malloc(size_t size) { return fails() ? nullptr : __libc_malloc(size); }
void* calloc(size_t count, size_t size) { return fails() ? nullptr : __libc_calloc(count, size); }
void* realloc(void* old, size_t size) { return fails() ? nullptr : __libc_realloc(old, size); }
void* aligned_alloc(size_t alignment, size_t size) {
  return fails() ? nullptr : __libc_memalign(alignment, size);
}
int posix_memalign(void** out, size_t alignment, size_t size) {
  *out = fails() ? nullptr : __libc_memalign(alignment, size);
  return *out ? 0 : ENOMEM;
}

int sigaction(int signal, const struct sigaction* action, struct sigaction* old) {
  using F = int(int, const struct sigaction*, struct sigaction*);
  const auto next = reinterpret_cast<F*>(::dlsym(RTLD_NEXT, "sigaction"));
  if (signal == SIGINT) g_counts = true;
  return next(signal, action, old);
}

}  // extern "C"
