#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

namespace isobrick {

/// The first thing found in `folder` that no store of ours has there, as a path relative to it:
/// a file or folder of another name, a link, a device. Nothing if there is none. `place` is where
/// in a store the folder lies: "" for a store, "isobrick/0/index/octree" for that index.
/// Temporary files and what an interrupted conversion leaves belong to a store.
std::optional<std::filesystem::path> find_foreign_entry(const std::filesystem::path& folder,
                                                        const std::filesystem::path& place = {});

/// Why `folder` is not a store of ours and nothing else, as the end of a sentence; empty if it is
/// one. Only such folders may be replaced.
std::string why_not_our_store(const std::filesystem::path& folder);

/// Throws UsageError when `folder`, which lies at `place` in a store, must stay: something in it
/// is not what we write there, or it holds one of `inputs` or the current directory. There may be
/// no such folder.
void check_replaceable(const std::filesystem::path& folder, const std::filesystem::path& place,
                       std::span<const std::filesystem::path> inputs = {});

}  // namespace isobrick
