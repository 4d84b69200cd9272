#pragma once

#include <filesystem>

namespace isobrick {

/// Lets two folders (or files) on one disk change places: in one step where the file system
/// can, else by exchange_by_renames(). Throws Error; both are where they were then.
void exchange(const std::filesystem::path& a, const std::filesystem::path& b);

/// The same in three steps: for an instant there is nothing at `b`.
void exchange_by_renames(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace isobrick
