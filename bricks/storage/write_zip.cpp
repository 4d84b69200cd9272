#include "bricks/storage/write_zip.h"

#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "bricks/storage/storage_keys.h"
#include "core/cancellable_progress.h"

namespace isobrick::inline v0 {
namespace {

struct ArchiveDeleter {
  void operator()(archive* zip) const { archive_write_free(zip); }
};

struct EntryDeleter {
  void operator()(archive_entry* entry) const { archive_entry_free(entry); }
};

void find_keys(const Storage& storage, const std::string& folder, std::vector<std::string>& keys) {
  for (const std::string& name : storage.list(folder)) {
    const std::string key = join_key(folder, name);
    if (storage.open(key) != nullptr)
      keys.push_back(key);
    else
      find_keys(storage, key, keys);
  }
}

/// Metadata first, those of the root before others: a reader on a network needs them at once.
auto place_of(const std::string& key) {
  const std::string name = key.substr(key.rfind('/') + 1);
  return std::tuple(std::ranges::find(kZarrFiles, name) == kZarrFiles.end(),
                    std::ranges::count(key, '/'), key);
}

/// A zip that is written by libarchive into a FileWriter.
class ZipWriter {
 public:
  explicit ZipWriter(FileWriter& out) : out_(out), zip_(archive_write_new()) {
    if (!zip_) throw std::bad_alloc();
    check(archive_write_set_format_zip(zip_.get()));
    check(archive_write_zip_set_compression_store(zip_.get()));
    check(archive_write_set_bytes_per_block(zip_.get(), 0));  // `out` has a buffer
    check(archive_write_open(zip_.get(), this, nullptr, &ZipWriter::write, nullptr));
  }

  void begin_entry(const std::string& key, std::uint64_t size) {
    const std::unique_ptr<archive_entry, EntryDeleter> entry(archive_entry_new());
    if (!entry) throw std::bad_alloc();
    archive_entry_set_pathname(entry.get(), key.c_str());
    archive_entry_set_filetype(entry.get(), AE_IFREG);
    archive_entry_set_perm(entry.get(), 0644);
    archive_entry_set_size(entry.get(), static_cast<la_int64_t>(size));
    // One of the first times that a zip can tell: equal stores make equal zips.
    archive_entry_set_mtime(entry.get(), 315705600, 0);
    check(archive_write_header(zip_.get(), entry.get()));
  }
  void append(std::span<const std::byte> bytes) {
    if (archive_write_data(zip_.get(), bytes.data(), bytes.size()) !=
        static_cast<la_ssize_t>(bytes.size()))
      fail();
  }
  void finish() { check(archive_write_close(zip_.get())); }

 private:
  /// libarchive is C: no exception passes through it.
  static la_ssize_t write(archive*, void* self, const void* bytes, std::size_t size) {
    auto& writer = *static_cast<ZipWriter*>(self);
    try {
      writer.out_.append({static_cast<const std::byte*>(bytes), size});
      return static_cast<la_ssize_t>(size);
    } catch (...) {
      writer.failure_ = std::current_exception();
      return -1;
    }
  }

  void check(int result) const {
    if (result != ARCHIVE_OK) fail();
  }
  [[noreturn]] void fail() const {
    if (failure_) std::rethrow_exception(failure_);
    const char* why = archive_error_string(zip_.get());
    throw Error(fmt::format("cannot write a zip: {}", why != nullptr ? why : "unknown failure"));
  }

  FileWriter& out_;
  std::exception_ptr failure_;
  std::unique_ptr<archive, ArchiveDeleter> zip_;
};

}  // namespace

void write_zip(const Storage& storage, const std::function<bool(const std::string& key)>& wanted,
               FileWriter& out, Progress& progress) {
  std::vector<std::string> keys;
  find_keys(storage, "", keys);
  std::erase_if(keys, [&](const std::string& key) { return !wanted(key); });
  if (keys.empty()) throw Error(fmt::format("'{}' has nothing to put into a zip", storage.name()));
  std::sort(keys.begin(), keys.end(),
            [](const std::string& a, const std::string& b) { return place_of(a) < place_of(b); });
  std::uint64_t total = 0;
  for (const std::string& key : keys)
    if (const auto object = storage.open(key)) total += object->size();
  progress.begin("zip", total);
  ZipWriter zip(out);
  std::vector<std::byte> buffer(FileWriter::kBuffer);
  for (const std::string& key : keys) {
    const auto object = storage.open(key);
    if (!object) throw Error(fmt::format("{} was removed while it was read", quoted(storage, key)));
    const std::uint64_t size = object->size();
    zip.begin_entry(key, size);
    for (std::uint64_t at = 0; at < size;) {
      const auto piece = std::min<std::uint64_t>(size - at, buffer.size());
      object->read(at, {buffer.data(), piece});
      zip.append({buffer.data(), piece});
      progress.advance(piece);
      at += piece;
    }
  }
  zip.finish();
  progress.end();
}

std::uint64_t write_zip(const Storage& storage, const std::filesystem::path& out,
                        const ZipOptions& options, Progress& listener) {
  CancellableProgress progress(listener, options.cancel);
  OutputFile file(out.string(), options.force);
  write_zip(
      storage, [](const std::string&) { return true; }, file.writer(), progress);
  file.publish();
  return file.writer().size();
}

}  // namespace isobrick
