#include "bricks/storage/folder_storage.h"

#include <utility>

#include "io/bytes/file.h"
#include "io/bytes/folder_walk.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

class FileObject final : public StoredObject {
 public:
  explicit FileObject(File file) : file_(std::move(file)) {}

  std::string name() const override { return file_.path().string(); }
  std::uint64_t size() const override { return file_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    file_.read_at(offset, bytes);
  }
  void will_need(std::uint64_t offset, std::uint64_t size) const override {
    file_.will_need(offset, size);
  }

 private:
  File file_;
};

class FolderStorage final : public Storage {
 public:
  explicit FolderStorage(fs::path folder) : folder_(std::move(folder)) {}

  std::string name() const override { return folder_.string(); }
  std::string name_of(const std::string& key) const override { return (folder_ / key).string(); }
  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    const fs::path path = folder_ / key;
    std::error_code failure;
    if (fs::is_directory(path, failure)) return nullptr;  // it may hold objects, but is none
    return open_file_object(path);
  }
  std::vector<std::string> list(const std::string& folder) const override {
    const fs::path path = folder_ / folder;
    std::error_code failure;
    const fs::file_type type = fs::status(path, failure).type();
    if (type == fs::file_type::not_found || type == fs::file_type::regular) return {};
    std::vector<std::string> names;
    for (FolderEntry& entry : folder_entries(path)) names.push_back(std::move(entry.name));
    return names;
  }
  fs::path local_path() const override { return folder_; }

 private:
  fs::path folder_;
};

}  // namespace

std::shared_ptr<const StoredObject> open_file_object(const fs::path& path) {
  File file = open_if_exists(path);
  return file ? std::make_shared<const FileObject>(std::move(file)) : nullptr;
}

std::shared_ptr<const Storage> folder_storage(const fs::path& folder) {
  return std::make_shared<const FolderStorage>(folder);
}

}  // namespace isobrick
