#pragma once

#include <filesystem>

namespace isobrick::inline v0 {

/// Lets two things in an open folder change places: in one step where the file system can, else
/// by exchange_by_renames(). Throws Error; both are where they were then.
void exchange(int folder, const std::filesystem::path& a, const std::filesystem::path& b);

/// The same in three steps: for an instant there is nothing at `b`, and what was there has
/// set_aside_name(b).
void exchange_by_renames(int folder, const std::filesystem::path& a,
                         const std::filesystem::path& b);

/// Where a kill between those steps may leave what was at `path`.
std::filesystem::path set_aside_name(const std::filesystem::path& path);

}  // namespace isobrick
