#include "bricks/storage/zip_directory.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>

#include <isobrick/error.h>
#include "core/printable.h"

// The structures are those of PKWARE's APPNOTE.TXT, 4.3. All numbers are little endian.

namespace isobrick::inline v0 {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::uint32_t kLocalHeader = 0x04034b50, kEntryRecord = 0x02014b50,
                        kEndRecord = 0x06054b50, kEndRecord64 = 0x06064b50,
                        kEndLocator64 = 0x07064b50;
constexpr std::size_t kLocalHeaderBytes = 30, kEntryBytes = 46, kEndBytes = 22, kEnd64Bytes = 56,
                      kLocatorBytes = 20;
/// The largest length of a name, of additional fields and of a comment.
constexpr std::size_t kMaxField = 0xffff;
constexpr std::size_t kMaxName = 4096;
constexpr std::size_t kPieceBytes = std::size_t{256} << 10;
static_assert(kPieceBytes >= kEntryBytes + 3 * kMaxField);
/// Stands for a number that has its place in ZIP64's fields.
constexpr std::uint64_t kIn64 = 0xffffffff, kIn64Short = 0xffff;

template <class T>
T number(Bytes bytes, std::size_t at) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof value; ++i)
    value = static_cast<T>(value | std::to_integer<T>(bytes[at + i]) << (8 * i));
  return value;
}
std::uint64_t u16(Bytes bytes, std::size_t at) { return number<std::uint16_t>(bytes, at); }
std::uint64_t u32(Bytes bytes, std::size_t at) { return number<std::uint32_t>(bytes, at); }
std::uint64_t u64(Bytes bytes, std::size_t at) { return number<std::uint64_t>(bytes, at); }

[[noreturn]] void damaged(const StoredObject& zip, const std::string& what) {
  throw DamageError(fmt::format("'{}' is a damaged zip: {}", zip.name(), what));
}

std::string shown(std::string_view name) { return "'" + printable(name, 200) + "'"; }

std::vector<std::byte> read(const StoredObject& zip, std::uint64_t offset, std::size_t size) {
  std::vector<std::byte> bytes(size);
  zip.read(offset, bytes);
  return bytes;
}

/// Where the directory lies.
struct DirectoryPlace {
  std::uint64_t begin = 0, size = 0, entries = 0;
};

DirectoryPlace place_of(const StoredObject& zip, std::uint64_t disks, DirectoryPlace place,
                        std::uint64_t end) {
  if (disks != 0) damaged(zip, "it is a part of one, or not whole");
  if (place.begin > end || place.size > end - place.begin)
    damaged(zip, fmt::format("its directory of {} bytes at offset {} goes beyond offset {}",
                             place.size, place.begin, end));
  if (place.entries > place.size / kEntryBytes)
    damaged(zip, fmt::format("its directory of {} bytes cannot list {} entries", place.size,
                             place.entries));
  return place;
}

/// The same by ZIP64's record, whose locator is `locator`; `plain` has what the other record does.
DirectoryPlace find_directory64(const StoredObject& zip, Bytes locator, std::uint64_t locator_at,
                                const DirectoryPlace& plain) {
  const std::uint64_t at = u64(locator, 8);
  if (locator_at < kEnd64Bytes || at > locator_at - kEnd64Bytes)
    damaged(zip, fmt::format("its ZIP64 record is said to be at offset {}", at));
  const std::vector<std::byte> record = read(zip, at, kEnd64Bytes);
  if (u32(record, 0) != kEndRecord64)
    damaged(zip, fmt::format("there is no ZIP64 record at offset {}", at));
  const DirectoryPlace place{u64(record, 48), u64(record, 40), u64(record, 32)};
  const auto agree = [](std::uint64_t number, std::uint64_t plain_number, std::uint64_t in64) {
    return plain_number == number || plain_number == in64;
  };
  if (!agree(place.begin, plain.begin, kIn64) || !agree(place.size, plain.size, kIn64) ||
      !agree(place.entries, plain.entries, kIn64Short))
    damaged(zip, "its ZIP64 record contradicts the other one");
  const std::uint64_t others = place.entries ^ u64(record, 24);
  return place_of(zip, u32(record, 16) | u32(record, 20) | others, place, at);
}

DirectoryPlace find_directory(const StoredObject& zip) {
  const std::uint64_t size = zip.size();
  const std::uint64_t tail_at =
      size - std::min<std::uint64_t>(size, kLocatorBytes + kEndBytes + kMaxField);
  const std::vector<std::byte> tail = read(zip, tail_at, static_cast<std::size_t>(size - tail_at));
  std::optional<std::size_t> found;
  // A comment of any length comes last.
  for (std::size_t at = tail.size(); at-- > 0 && !found;)
    if (tail.size() - at >= kEndBytes && u32(tail, at) == kEndRecord &&
        u16(tail, at + 20) == tail.size() - at - kEndBytes)
      found = at;
  if (!found) damaged(zip, "it lacks the directory at its end");
  const Bytes record = Bytes(tail).subspan(*found, kEndBytes);
  const DirectoryPlace plain{u32(record, 16), u32(record, 12), u16(record, 10)};
  if (*found >= kLocatorBytes) {
    const std::size_t locator_at = *found - kLocatorBytes;
    const Bytes locator = Bytes(tail).subspan(locator_at, kLocatorBytes);
    if (u32(locator, 0) == kEndLocator64)
      return find_directory64(zip, locator, tail_at + locator_at, plain);
  }
  const std::uint64_t others = plain.entries ^ u16(record, 8);
  return place_of(zip, u16(record, 4) | u16(record, 6) | others, plain, tail_at + *found);
}

/// Reads the directory from its beginning to its end, in pieces.
class DirectoryReader {
 public:
  DirectoryReader(const StoredObject& zip, const DirectoryPlace& place)
      : zip_(zip), next_(place.begin), left_(place.size) {}

  bool at_end() const { return left_ == 0 && at_ == piece_.size(); }
  /// The next bytes, valid until the next call.
  Bytes take(std::size_t size) {
    if (piece_.size() - at_ < size) read_piece();
    if (piece_.size() - at_ < size) damaged(zip_, "its directory ends within an entry");
    at_ += size;
    return Bytes(piece_).subspan(at_ - size, size);
  }

 private:
  void read_piece() {
    const auto more = static_cast<std::size_t>(std::min<std::uint64_t>(left_, kPieceBytes));
    std::vector<std::byte> piece(piece_.size() - at_ + more);
    std::copy(piece_.begin() + static_cast<std::ptrdiff_t>(at_), piece_.end(), piece.begin());
    zip_.read(next_, std::span(piece).last(more));
    next_ += more;
    left_ -= more;
    piece_ = std::move(piece);
    at_ = 0;
  }

  const StoredObject& zip_;
  std::uint64_t next_, left_;
  std::vector<std::byte> piece_;
  std::size_t at_ = 0;  ///< in the piece, what comes next
};

/// ZIP64's numbers of an entry: those of its other fields that are kIn64, in this order.
class Numbers64 {
 public:
  explicit Numbers64(Bytes extra) {
    while (extra.size() >= 4) {
      const std::uint64_t id = u16(extra, 0), size = u16(extra, 2);
      extra = extra.subspan(4);
      if (size > extra.size()) return;
      if (id == 1) numbers_ = extra.first(static_cast<std::size_t>(size));
      extra = extra.subspan(static_cast<std::size_t>(size));
    }
  }
  /// False where the number is missing.
  bool replace(std::uint64_t& field) {
    if (field != kIn64) return true;
    if (numbers_.size() < sizeof field) return false;
    field = u64(numbers_, 0);
    numbers_ = numbers_.subspan(sizeof field);
    return true;
  }

 private:
  Bytes numbers_;
};

/// Whether `is_refused` holds of any part of a name between slashes.
template <class F>
bool any_part(std::string_view name, F&& is_refused) {
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    if (is_refused(name.substr(begin, end - begin))) return true;
    begin = end + 1;
  }
  return false;
}

bool leads_out(std::string_view name) {
  return name.empty() || name.front() == '/' || name.find('\0') != name.npos ||
         any_part(name, [](std::string_view part) { return part == ".."; });
}

/// Keys have no such parts: the entry could be listed, but not be opened.
bool is_no_key(std::string_view name) {
  return any_part(name, [](std::string_view part) { return part.empty() || part == "."; });
}

ZipEntry::Form form_of(std::uint64_t flags, std::uint64_t method) {
  constexpr std::uint64_t kEncrypted = 1 | 1 << 13;
  if ((flags & kEncrypted) != 0) return ZipEntry::Form::encrypted;
  return method == 0 ? ZipEntry::Form::stored : ZipEntry::Form::compressed;
}

/// Reads the next entry; its bytes lie before `data_end`.
ZipEntry read_entry(const StoredObject& zip, DirectoryReader& reader, std::uint64_t data_end) {
  std::array<std::byte, kEntryBytes> fixed;
  std::ranges::copy(reader.take(kEntryBytes), fixed.begin());
  if (u32(fixed, 0) != kEntryRecord) damaged(zip, "its directory holds what is no entry");
  const auto length = [&](std::size_t at) { return static_cast<std::size_t>(u16(fixed, at)); };
  const std::size_t name_bytes = length(28), extra_bytes = length(30), comment_bytes = length(32);
  const Bytes rest = reader.take(name_bytes + extra_bytes + comment_bytes);
  ZipEntry entry;
  entry.name.assign(reinterpret_cast<const char*>(rest.data()), name_bytes);
  entry.form = form_of(u16(fixed, 8), u16(fixed, 10));
  if (name_bytes > kMaxName || leads_out(entry.name))
    damaged(zip, fmt::format("the name of its entry {} is no relative path", shown(entry.name)));
  std::uint64_t size = u32(fixed, 24);
  entry.size = u32(fixed, 20);
  entry.header = u32(fixed, 42);
  Numbers64 numbers(rest.subspan(name_bytes, extra_bytes));
  if (!numbers.replace(size) || !numbers.replace(entry.size) || !numbers.replace(entry.header))
    damaged(zip, fmt::format("its entry {} lacks the numbers of ZIP64", shown(entry.name)));
  const std::uint64_t before = kLocalHeaderBytes + name_bytes;
  if (entry.header > data_end || before > data_end - entry.header ||
      entry.size > data_end - entry.header - before)
    damaged(zip, fmt::format("its entry {}, {} bytes from offset {} on, goes beyond offset {}",
                             shown(entry.name), entry.size, entry.header, data_end));
  if (entry.form == ZipEntry::Form::stored && size != entry.size)
    damaged(zip, fmt::format("its entry {} has two sizes, {} and {}", shown(entry.name), size,
                             entry.size));
  return entry;
}

bool is_less(const ZipEntry& entry, const std::string& name) { return entry.name < name; }

}  // namespace

ZipDirectory::ZipDirectory(const StoredObject& zip) {
  const DirectoryPlace place = find_directory(zip);
  begin_ = place.begin;
  DirectoryReader reader(zip, place);
  std::uint64_t count = 0;
  for (; !reader.at_end(); ++count) {
    ZipEntry entry = read_entry(zip, reader, begin_);
    if (entry.name.ends_with('/')) continue;  // a folder
    if (is_no_key(entry.name))
      damaged(zip,
              fmt::format("the name of its entry {} has an empty part or '.'", shown(entry.name)));
    entries_.push_back(std::move(entry));
  }
  if (count != place.entries)
    damaged(zip, fmt::format("its directory lists {} entries, not {}", count, place.entries));
  std::ranges::sort(entries_, {}, &ZipEntry::name);
  const auto twice = std::ranges::adjacent_find(entries_, {}, &ZipEntry::name);
  if (twice != entries_.end())
    damaged(zip, fmt::format("it has the entry {} twice; unpack it and make it anew",
                             shown(twice->name)));
}

const ZipEntry* ZipDirectory::first_from(const std::string& name) const {
  const auto found = std::lower_bound(entries_.begin(), entries_.end(), name, is_less);
  return found == entries_.end() ? nullptr : &*found;
}

const ZipEntry* ZipDirectory::find(const std::string& name) const {
  const ZipEntry* const entry = first_from(name);
  return entry != nullptr && entry->name == name ? entry : nullptr;
}

void ZipDirectory::will_need(const StoredObject& zip, const ZipEntry& entry) {
  zip.will_need(entry.header, kLocalHeaderBytes + entry.name.size());
}

std::uint64_t ZipDirectory::data_of(const StoredObject& zip, const ZipEntry& entry) const {
  const std::vector<std::byte> header =
      read(zip, entry.header, kLocalHeaderBytes + entry.name.size());
  const Bytes name = Bytes(header).subspan(kLocalHeaderBytes);
  if (u32(header, 0) != kLocalHeader || form_of(u16(header, 6), u16(header, 8)) != entry.form ||
      u16(header, 26) != name.size() ||
      std::memcmp(name.data(), entry.name.data(), name.size()) != 0)
    damaged(zip, fmt::format("at offset {} is not the entry {} that its directory has there",
                             entry.header, shown(entry.name)));
  const std::uint64_t data = entry.header + header.size() + u16(header, 28);
  if (data > begin_ || entry.size > begin_ - data)
    damaged(zip, fmt::format("its entry {} goes beyond offset {}", shown(entry.name), begin_));
  return data;
}

}  // namespace isobrick
