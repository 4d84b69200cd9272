#pragma once

#include <filesystem>
#include <memory>

#include <isobrick/storage.h>

namespace isobrick::inline v0 {

/// A file as an object; null when there is none. Throws what open_if_exists() does.
std::shared_ptr<const StoredObject> open_file_object(const std::filesystem::path& path);

}  // namespace isobrick
