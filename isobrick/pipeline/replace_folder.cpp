#include "isobrick/pipeline/replace_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "isobrick/core/error.h"
#include "isobrick/io/exchange.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

void rename_or_throw(const fs::path& from, const fs::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0)
    throw system_error(fmt::format("rename '{}' to", from.string()), to.string(), errno);
}

void sync_folder(const fs::path& folder) {
  const UniqueFd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0 || ::fsync(fd.get()) != 0) throw system_error("sync", folder.string(), errno);
}

}  // namespace

void replace_folder(const fs::path& finished, const fs::path& place) {
  const fs::path parent = place.has_parent_path() ? place.parent_path() : fs::path(".");
  if (fs::symlink_status(place).type() == fs::file_type::not_found) {
    rename_or_throw(finished, place);
  } else {
    exchange(finished, place);
    sync_folder(parent);
    fs::remove_all(finished);
  }
  sync_folder(parent);
}

}  // namespace isobrick
