#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>

namespace isobrick::test {

/// How a ZipWriter writes.
struct ZipForm {
  bool zip64 = false;        ///< all numbers stand in ZIP64's fields
  bool descriptors = false;  ///< sizes follow the data, as where a zip is written to a pipe
};

/// What is special about an entry.
struct ZipEntryForm {
  std::uint64_t method = 0;   ///< 0: stored
  std::uint64_t flags = 0;    ///< 1: encrypted
  std::uint64_t more = 0;     ///< added to the size that the directory has
  std::uint64_t further = 0;  ///< added to the offset that the directory has
};

/// What the end of a zip says of its directory.
struct ZipEnd {
  std::uint64_t entries, size, begin;
};

/// A zip in memory. Its checksums are 0: storages do not look at them.
class ZipWriter {
 public:
  explicit ZipWriter(ZipForm form = {}) : form_(form) {}

  void add(const std::string& name, const std::string& bytes, const ZipEntryForm& entry = {}) {
    const std::uint64_t header = zip_.size() + entry.further, size = bytes.size();
    const std::uint64_t flags = entry.flags | (form_.descriptors ? 8U : 0U);
    const std::uint64_t early = form_.descriptors ? 0 : size;
    const std::string local64 = extra64({early, early});
    put(zip_, 4, {0x04034b50});
    put(zip_, 2, {20, flags, entry.method, 0, 0});
    put(zip_, 4, {0, in32(early), in32(early)});
    put(zip_, 2, {name.size(), local64.size()});
    zip_ += name + local64 + bytes;
    if (form_.descriptors) {
      put(zip_, 4, {0x08074b50, 0});
      put(zip_, form_.zip64 ? 8 : 4, {size, size});
    }
    const std::string extra = extra64({size + entry.more, size + entry.more, header});
    put(directory_, 4, {0x02014b50});
    put(directory_, 2, {20, 20, flags, entry.method, 0, 0});
    put(directory_, 4, {0, in32(size + entry.more), in32(size + entry.more)});
    put(directory_, 2, {name.size(), extra.size(), 0, 0, 0});
    put(directory_, 4, {0, in32(header)});
    directory_ += name + extra;
    ++entries_;
  }

  /// What a sound zip says.
  ZipEnd end() const { return {entries_, directory_.size(), zip_.size()}; }
  std::string finish(const std::string& comment = "") const { return finish(end(), comment); }
  std::string finish(const ZipEnd& end, const std::string& comment = "") const {
    std::string zip = zip_ + directory_;
    const std::uint64_t at = zip.size();
    if (form_.zip64) {
      put(zip, 4, {0x06064b50});
      put(zip, 8, {44});
      put(zip, 2, {45, 45});
      put(zip, 4, {0, 0});
      put(zip, 8, {end.entries, end.entries, end.size, end.begin});
      put(zip, 4, {0x07064b50, 0});
      put(zip, 8, {at});
      put(zip, 4, {1});
    }
    const std::uint64_t entries = form_.zip64 ? 0xffff : end.entries;
    put(zip, 4, {0x06054b50});
    put(zip, 2, {0, 0, entries, entries});
    put(zip, 4, {in32(end.size), in32(end.begin)});
    put(zip, 2, {comment.size()});
    return zip + comment;
  }

 private:
  static void put(std::string& to, int bytes, std::initializer_list<std::uint64_t> values) {
    for (const std::uint64_t value : values)
      for (int i = 0; i < bytes; ++i) to += static_cast<char>(value >> (8 * i));
  }
  std::uint64_t in32(std::uint64_t value) const { return form_.zip64 ? 0xffffffff : value; }
  std::string extra64(std::initializer_list<std::uint64_t> values) const {
    std::string extra;
    if (!form_.zip64) return extra;
    put(extra, 2, {1, 8 * values.size()});
    put(extra, 8, values);
    return extra;
  }

  ZipForm form_;
  std::string zip_, directory_;
  std::uint64_t entries_ = 0;
};

}  // namespace isobrick::test
