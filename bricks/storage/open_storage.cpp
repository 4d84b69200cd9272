#include "bricks/storage/open_storage.h"

#include <fmt/format.h>

#include <utility>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "bricks/storage/remote_storage.h"
#include "bricks/storage/storage_keys.h"
#include "io/bytes/file.h"
#include "io/bytes/url.h"
#include "io/bytes/zip_signature.h"

namespace isobrick::inline v0 {

namespace fs = std::filesystem;

namespace {

bool is_zip_file(const fs::path& path) {
  return path.extension() == ".zip" || is_zip_head(open_input(path).text_at(0, 4));
}

/// The objects of another storage whose keys begin with a folder.
class FolderOfStorage final : public Storage {
 public:
  FolderOfStorage(std::shared_ptr<const Storage> whole, std::string folder)
      : whole_(std::move(whole)), folder_(std::move(folder)) {}

  std::string name() const override { return whole_->name() + "/" + folder_; }
  std::string name_of(const std::string& key) const override { return whole_->name_of(inner(key)); }
  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    return whole_->open(inner(key));
  }
  void will_open(const std::string& key) const override { whole_->will_open(inner(key)); }
  std::vector<std::string> list(const std::string& folder) const override {
    return whole_->list(inner(folder));
  }
  bool is_remote() const override { return whole_->is_remote(); }
  std::uint64_t memory() const override { return whole_->memory(); }
  fs::path local_path() const override { return whole_->local_path(); }

 private:
  std::string inner(const std::string& key) const { return join_key(folder_, key); }

  std::shared_ptr<const Storage> whole_;
  std::string folder_;
};

}  // namespace

std::optional<FolderInZip> find_folder_in_zip(const fs::path& path) {
  std::error_code none;
  if (fs::exists(path, none)) return std::nullopt;
  for (fs::path zip = path.parent_path(); !zip.empty(); zip = zip.parent_path()) {
    const fs::file_status status = fs::status(zip, none);
    if (fs::is_directory(status)) return std::nullopt;
    if (!fs::is_regular_file(status)) continue;
    const fs::path folder = path.lexically_relative(zip);
    if (!is_zip_file(zip) || *folder.begin() == "..") return std::nullopt;
    return FolderInZip{zip, join_key("", folder.generic_string())};
  }
  return std::nullopt;
}

bool is_zip(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none) ? is_zip_file(path) : find_folder_in_zip(path).has_value();
}

std::shared_ptr<const Storage> open_storage(const fs::path& path, const RemoteOptions& options) {
  if (is_url(path.native())) return open_remote_storage(path.native(), options);
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (const auto place = find_folder_in_zip(path))
    return std::make_shared<FolderOfStorage>(zip_storage(place->zip), place->folder);
  if (status.type() == fs::file_type::none)
    throw system_error("open", path.string(), failure.value());
  if (fs::is_directory(status)) return folder_storage(path);
  if (is_zip(path)) return zip_storage(path);
  throw Error(fmt::format("'{}' is no store: neither a folder nor a zip", path.string()));
}

}  // namespace isobrick
