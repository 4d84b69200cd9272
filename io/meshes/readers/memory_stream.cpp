#include "io/meshes/readers/memory_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "io/bytes/mapped_file.h"

namespace isobrick::inline v0 {
namespace {

class MemoryStream final : public ByteStream {
 public:
  MemoryStream(std::string name, std::span<const std::byte> bytes)
      : name_(std::move(name)), rest_(bytes), all_(bytes.size()) {}

  std::size_t read(std::byte* out, std::size_t size) override {
    const std::size_t count = std::min(size, rest_.size());
    if (count > 0) std::memcpy(out, rest_.data(), count);
    rest_ = rest_.subspan(count);
    MappedFile::note_read(count);
    return count;
  }
  std::string name() const override { return name_; }
  std::uint64_t max_bytes() const override { return all_; }

 private:
  std::string name_;
  std::span<const std::byte> rest_;
  std::uint64_t all_;  ///< bytes, read or not
};

}  // namespace

std::unique_ptr<ByteStream> make_memory_stream(const std::string& path,
                                               std::span<const std::byte> bytes) {
  return std::make_unique<MemoryStream>(fmt::format("'{}'", path), bytes);
}

}  // namespace isobrick
