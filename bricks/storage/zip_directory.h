#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/storage.h>

namespace isobrick::inline v0 {

/// An entry of a zip.
struct ZipEntry {
  enum class Form : std::uint8_t { stored, compressed, encrypted };

  std::string name;
  std::uint64_t header = 0;  ///< where its own header begins in the zip
  std::uint64_t size = 0;    ///< bytes in the zip
  Form form = Form::stored;
};

/// What the directory at the end of a zip lists. Thread-safe.
class ZipDirectory {
 public:
  /// Reads the directory, of a zip with or without ZIP64's fields. Throws DamageError for what is
  /// damaged, for two entries of one name and for names that lead out of the zip.
  explicit ZipDirectory(const StoredObject& zip);

  /// The entries but those of folders, sorted by their names.
  const std::vector<ZipEntry>& entries() const { return entries_; }
  /// The first entry whose name is not less than this one; null: none.
  const ZipEntry* first_from(const std::string& name) const;
  /// Null where there is none.
  const ZipEntry* find(const std::string& name) const;
  /// Where the bytes of a stored entry begin; they all lie within the zip. Reads the entry's own
  /// header. Throws DamageError when that contradicts the directory.
  std::uint64_t data_of(const StoredObject& zip, const ZipEntry& entry) const;
  /// Hints that data_of() is called soon.
  static void will_need(const StoredObject& zip, const ZipEntry& entry);

 private:
  std::vector<ZipEntry> entries_;
  std::uint64_t begin_ = 0;  ///< of the directory: where the data end
};

}  // namespace isobrick
