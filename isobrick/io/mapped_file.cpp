#include "isobrick/io/mapped_file.h"

#include <sys/mman.h>

#include <cerrno>

#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {

MappedFile::MappedFile(const std::string& path) {
  const File file = open_input(path);
  size_ = static_cast<std::size_t>(file.size());
  if (size_ == 0) return;
  void* first = ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, file.fd(), 0);
  if (first == MAP_FAILED) throw system_error("map", path, errno);
  first_ = static_cast<const std::byte*>(first);
}

MappedFile::~MappedFile() {
  if (first_ != nullptr) ::munmap(const_cast<std::byte*>(first_), size_);
}

}  // namespace isobrick
