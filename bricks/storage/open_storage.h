#pragma once

#include <filesystem>

namespace isobrick::inline v0 {

/// Whether a file is a zip, by its content or else by its name.
bool is_zip(const std::filesystem::path& path);

}  // namespace isobrick
