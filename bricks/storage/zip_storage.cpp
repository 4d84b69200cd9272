#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "bricks/storage/folder_storage.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/storage/zip_directory.h"
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

/// A part of another object.
class PartOfObject final : public StoredObject {
 public:
  PartOfObject(std::string name, std::shared_ptr<const StoredObject> whole, std::uint64_t begin,
               std::uint64_t size)
      : name_(std::move(name)), whole_(std::move(whole)), begin_(begin), size_(size) {}

  std::string name() const override { return name_; }
  std::uint64_t size() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    check_range(*this, offset, bytes.size());
    whole_->read(begin_ + offset, bytes);
  }
  void will_need(std::uint64_t offset, std::uint64_t size) const override {
    whole_->will_need(begin_ + offset, size);
  }

 private:
  std::string name_;
  std::shared_ptr<const StoredObject> whole_;
  std::uint64_t begin_, size_;
};

bool holds_zarr(const ZipDirectory& directory, const std::string& prefix) {
  return std::ranges::any_of(
      kZarrFiles, [&](const char* name) { return directory.find(prefix + name) != nullptr; });
}

class ZipStorage final : public Storage {
 public:
  ZipStorage(std::shared_ptr<const StoredObject> zip, std::filesystem::path path)
      : zip_(std::move(zip)), path_(std::move(path)), directory_(*zip_), top_(find_top()) {}

  std::string name() const override { return zip_->name(); }
  std::string name_of(const std::string& key) const override {
    return Storage::name_of(top_ + key);
  }
  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    const ZipEntry* const entry = directory_.find(top_ + key);
    if (entry == nullptr) return nullptr;
    if (entry->form != ZipEntry::Form::stored)
      throw Error(fmt::format(
          "'{}' is {}: only what a zip stores as it is can be read; make one so: cd STORE && "
          "zip -0 -r ../STORE.zip .",
          name_of(key), entry->form == ZipEntry::Form::compressed ? "compressed" : "encrypted"));
    return std::make_shared<const PartOfObject>(name_of(key), zip_,
                                                directory_.data_of(*zip_, *entry), entry->size);
  }
  std::vector<std::string> list(const std::string& folder) const override {
    return names_below(folder.empty() ? top_.substr(0, top_.find('/')) : top_ + folder);
  }
  void will_open(const std::string& key) const override {
    if (const ZipEntry* const entry = directory_.find(top_ + key))
      directory_.will_need(*zip_, *entry);
  }
  bool is_remote() const override { return path_.empty(); }  // as far as anybody knows
  std::filesystem::path local_path() const override { return path_; }

 private:
  std::vector<std::string> names_below(const std::string& folder) const {
    return list_keys(folder, [&](const std::string& text) {
      const ZipEntry* const entry = directory_.first_from(text);
      return entry == nullptr ? nullptr : &entry->name;
    });
  }

  /// What the names of the store's entries begin with: "" or "TOP/".
  std::string find_top() const {
    std::string found;
    if (holds_zarr(directory_, "")) return found;
    for (const std::string& name : names_below("")) {
      std::string top = name + '/';
      if (!holds_zarr(directory_, top)) continue;
      if (!found.empty())
        throw Error(fmt::format("'{}' holds several stores, '{}' and '{}': zip one alone",
                                zip_->name(), printable(found, 80), printable(top, 80)));
      found = std::move(top);
    }
    return found;
  }

  std::shared_ptr<const StoredObject> zip_;
  std::filesystem::path path_;
  ZipDirectory directory_;
  std::string top_;
};

}  // namespace

std::shared_ptr<const Storage> zip_storage(const std::filesystem::path& file) {
  auto zip = open_file_object(file);
  if (!zip) throw Error(fmt::format("'{}' does not exist", file.string()));
  return std::make_shared<const ZipStorage>(std::move(zip), file);
}

std::shared_ptr<const Storage> zip_storage(std::shared_ptr<const StoredObject> zip) {
  return std::make_shared<const ZipStorage>(std::move(zip), std::filesystem::path());
}

}  // namespace isobrick
