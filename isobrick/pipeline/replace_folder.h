#pragma once

#include <filesystem>

namespace isobrick {

/// Moves a finished folder to its place, in one step where the file system can;
/// only then removes the one that was there. Both lie in the same folder.
/// Durable when it returns.
void replace_folder(const std::filesystem::path& finished, const std::filesystem::path& place);

}  // namespace isobrick
