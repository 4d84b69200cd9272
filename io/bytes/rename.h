#pragma once

#include <filesystem>

namespace isobrick::inline v0 {

/// Renames a file or folder, replacing nothing: 0, EEXIST when something has the name `to` already,
/// or the errno of another failure.
int rename_no_replace(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace isobrick
