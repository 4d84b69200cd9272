#include "bricks/storage/cached_object.h"

#include <fcntl.h>
#include <isa-l/crc.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Bytes of one checksum: a part of a range is read without the rest.
constexpr std::uint64_t kBlock = std::uint64_t{64} << 10;
/// More than one request has.
constexpr std::uint64_t kMaxRangeBytes = std::uint64_t{64} << 20;

struct RangeName {
  std::uint64_t offset, size;
};

/// The range of a file "PREFIX-OFFSET-SIZE"; nullopt for another name.
std::optional<RangeName> parse_range_name(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  RangeName range{};
  const char* const end = name.data() + name.size();
  const auto offset = std::from_chars(name.data(), end, range.offset);
  if (offset.ec != std::errc() || offset.ptr == end || *offset.ptr != '-') return std::nullopt;
  const auto size = std::from_chars(offset.ptr + 1, end, range.size);
  if (size.ec != std::errc() || size.ptr != end || range.size == 0 || range.size > kMaxRangeBytes ||
      range.offset > UINT64_MAX - range.size)
    return std::nullopt;
  return range;
}

/// CRC-32C of a block, or of the checksums of a range.
std::uint32_t block_checksum(std::span<const std::byte> bytes) {
  auto* const data =
      const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(bytes.data()));
  return crc32_iscsi(data, static_cast<int>(bytes.size()), ~0u);
}

std::uint64_t block_count(std::uint64_t size) { return (size + kBlock - 1) / kBlock; }

/// Bytes of the file of a range: checksums, then the bytes.
std::uint64_t file_bytes(std::uint64_t size) {
  return (block_count(size) + 1) * sizeof(std::uint32_t) + size;
}

/// Checksums of the blocks of a range; the last is that of the others.
std::vector<std::uint32_t> block_checksums(std::span<const std::byte> bytes) {
  std::vector<std::uint32_t> checksums;
  for (std::size_t at = 0; at < bytes.size(); at += kBlock)
    checksums.push_back(
        block_checksum(bytes.subspan(at, std::min<std::size_t>(kBlock, bytes.size() - at))));
  checksums.push_back(block_checksum(std::as_bytes(std::span(checksums))));
  return checksums;
}

bool read_exactly(int fd, std::uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const ssize_t count = ::pread(fd, out.data(), out.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    offset += static_cast<std::uint64_t>(count);
    out = out.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

/// Fills `out` with bytes of a range from `begin` on, and compares the checksums of their blocks.
bool read_blocks(int fd, std::uint64_t range_size, std::uint64_t begin, std::span<std::byte> out) {
  std::vector<std::uint32_t> checksums(block_count(range_size) + 1);
  const auto table = std::as_writable_bytes(std::span(checksums));
  struct stat status {};
  if (::fstat(fd, &status) != 0 ||
      static_cast<std::uint64_t>(status.st_size) != file_bytes(range_size) ||
      !read_exactly(fd, 0, table) ||
      block_checksum(table.first(table.size() - sizeof(std::uint32_t))) != checksums.back())
    return false;
  std::vector<std::byte> part;
  for (std::uint64_t at = 0; at < out.size();) {
    const std::uint64_t block = (begin + at) / kBlock, first = block * kBlock,
                        size = std::min(kBlock, range_size - first), skipped = begin + at - first,
                        count = std::min(size - skipped, out.size() - at);
    const std::span<std::byte> wanted = out.subspan(at, count);
    std::span<std::byte> whole = wanted;
    if (count < size) {
      part.resize(kBlock);
      whole = std::span(part).first(size);
    }
    if (!read_exactly(fd, table.size() + first, whole) || block_checksum(whole) != checksums[block])
      return false;
    if (count < size)
      std::copy_n(part.begin() + static_cast<std::ptrdiff_t>(skipped), count, wanted.begin());
    at += count;
  }
  return true;
}

}  // namespace

CachedObject::CachedObject(std::shared_ptr<RangeCache> cache, const std::string& url,
                           const ObjectState& state, const std::string& root_url)
    : cache_(std::move(cache)),
      folder_(cache_->folder_of(url)),
      root_folder_(root_url.empty() ? fs::path() : cache_->folder_of(root_url)),
      prefix_(fmt::format("{:016x}-", state.hash())) {}

fs::path CachedObject::file_of(std::uint64_t offset, std::uint64_t size) const {
  return folder_ / fmt::format("{}{}-{}", prefix_, offset, size);
}

/// Reads once which ranges are there, and removes those of other states.
void CachedObject::list() const {
  if (std::exchange(is_listed_, true)) return;
  std::error_code failure;
  for (fs::directory_iterator entry(folder_, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string name = entry->path().filename().string();
    if (const auto range = parse_range_name(name, prefix_)) {
      std::error_code none;
      const bool is_whole = entry->file_size(none) == file_bytes(range->size);
      if (is_whole && !none)
        add(range->offset, range->size, false);
      else
        cache_->remove(entry->path());
    } else if (name.size() > prefix_.size() && name[prefix_.size() - 1] == '-' &&
               parse_range_name(name, name.substr(0, prefix_.size()))) {
      cache_->remove(entry->path());
    }
  }
}

/// The first piece that ends behind `offset`.
CachedObject::Pieces::iterator CachedObject::find_behind(std::uint64_t offset) const {
  const auto next = pieces_.upper_bound(offset);
  if (next == pieces_.begin()) return next;
  const auto before = std::prev(next);
  return offset < before->second.end ? before : next;
}

/// The piece that has the byte at `offset`, or the end.
CachedObject::Pieces::iterator CachedObject::find(std::uint64_t offset) const {
  list();
  const auto piece = find_behind(offset);
  return piece != pieces_.end() && piece->first <= offset ? piece : pieces_.end();
}

/// A range whose file is there: of use where no other has its bytes.
void CachedObject::add(std::uint64_t offset, std::uint64_t size, bool is_used) const {
  const std::uint64_t end = offset + size;
  for (std::uint64_t at = offset; at < end;) {
    const auto next = find_behind(at);
    const std::uint64_t free_to = next == pieces_.end() ? end : std::min(end, next->first);
    if (at < free_to) pieces_.emplace_hint(next, at, Piece{free_to, offset, size, is_used});
    at = next == pieces_.end() ? end : next->second.end;
  }
}

/// A file that is of no use.
void CachedObject::remove(std::uint64_t file_offset, std::uint64_t file_size) const {
  const std::lock_guard lock(mutex_);
  std::erase_if(pieces_, [&](const auto& piece) {
    return piece.second.file_offset == file_offset && piece.second.file_size == file_size;
  });
}

std::uint64_t CachedObject::missing(std::uint64_t offset, std::uint64_t size) const {
  const std::lock_guard lock(mutex_);
  list();
  const auto next = find_behind(offset);
  if (next == pieces_.end()) return size;
  return next->first <= offset ? 0 : std::min(size, next->first - offset);
}

bool CachedObject::has(std::uint64_t offset, std::uint64_t size) const {
  const std::lock_guard lock(mutex_);
  const std::uint64_t end = offset + size;
  while (offset < end) {
    const auto piece = find(offset);
    if (piece == pieces_.end()) return false;
    offset = piece->second.end;
  }
  return true;
}

std::size_t CachedObject::read(std::uint64_t offset, std::span<std::byte> out) const {
  Piece piece{};
  {
    const std::lock_guard lock(mutex_);
    const auto found = find(offset);
    if (found == pieces_.end()) return 0;
    piece = found->second;
    found->second.is_used = true;
  }
  const fs::path file = file_of(piece.file_offset, piece.file_size);
  const std::uint64_t count = std::min<std::uint64_t>(out.size(), piece.end - offset);
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (fd.get() >= 0 &&
      read_blocks(fd.get(), piece.file_size, offset - piece.file_offset, out.first(count))) {
    // The time of change is that of the last use: not every file system has another.
    if (!piece.is_used) static_cast<void>(::utimensat(AT_FDCWD, file.c_str(), nullptr, 0));
    return static_cast<std::size_t>(count);
  }
  if (fd.get() >= 0) cache_->remove(file);
  remove(piece.file_offset, piece.file_size);
  return 0;
}

void CachedObject::forget() const {
  cache_->forget(folder_);
  if (!root_folder_.empty()) cache_->note_change(root_folder_);
}

void CachedObject::write(std::uint64_t offset, std::span<const std::byte> bytes) const {
  if (bytes.empty() || bytes.size() > kMaxRangeBytes || has(offset, bytes.size())) return;
  const std::vector<std::uint32_t> checksums = block_checksums(bytes);
  if (!cache_->write(file_of(offset, bytes.size()), {std::as_bytes(std::span(checksums)), bytes}))
    return;
  const std::lock_guard lock(mutex_);
  add(offset, bytes.size(), true);
}

}  // namespace isobrick
