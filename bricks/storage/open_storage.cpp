#include "bricks/storage/open_storage.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "bricks/storage/remote_storage.h"
#include "io/bytes/file.h"
#include "io/bytes/url.h"
#include "io/bytes/zip_signature.h"

namespace isobrick::inline v0 {

namespace fs = std::filesystem;

bool is_zip(const fs::path& path) {
  std::error_code none;
  if (!fs::is_regular_file(path, none)) return false;
  return path.extension() == ".zip" || is_zip_head(open_input(path).text_at(0, 4));
}

std::shared_ptr<const Storage> open_storage(const fs::path& path, const RemoteOptions& options) {
  if (is_url(path.native())) return open_remote_storage(path.native(), options);
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (status.type() == fs::file_type::none)
    throw system_error("open", path.string(), failure.value());
  if (fs::is_directory(status)) return folder_storage(path);
  if (is_zip(path)) return zip_storage(path);
  throw Error(fmt::format("'{}' is no store: neither a folder nor a zip", path.string()));
}

}  // namespace isobrick
