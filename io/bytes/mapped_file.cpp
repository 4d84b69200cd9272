#include "io/bytes/mapped_file.h"

#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <mutex>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {
namespace {

/// All that are mapped.
class MappedSpans {
 public:
  void add(std::span<const std::byte> span) {
    const std::lock_guard lock(mutex_);
    spans_.push_back(span);
  }
  void remove(const std::byte* first) {
    const std::lock_guard lock(mutex_);
    std::erase_if(spans_, [&](std::span<const std::byte> span) { return span.data() == first; });
  }
  void drop_pages() {
    const std::lock_guard lock(mutex_);
    for (const std::span<const std::byte> span : spans_)
      (void)::madvise(const_cast<std::byte*>(span.data()), span.size(), MADV_DONTNEED);
  }

 private:
  std::mutex mutex_;
  std::vector<std::span<const std::byte>> spans_;
};

MappedSpans& mapped_spans() {
  static MappedSpans spans;
  return spans;
}

}  // namespace

MappedFile::MappedFile(const std::string& path) {
  const File file = open_input(path);
  size_ = static_cast<std::size_t>(file.size());
  if (size_ == 0) return;
  void* first = ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, file.fd(), 0);
  if (first == MAP_FAILED) throw system_error("map", path, errno);
  first_ = static_cast<const std::byte*>(first);
  mapped_spans().add(bytes());
}

MappedFile::~MappedFile() {
  if (first_ == nullptr) return;
  mapped_spans().remove(first_);
  ::munmap(const_cast<std::byte*>(first_), size_);
}

void MappedFile::note_read(std::size_t bytes) {
  thread_local std::size_t read = 0;
  read += bytes;
  if (read < kWindow) return;
  read = 0;
  mapped_spans().drop_pages();
}

}  // namespace isobrick
