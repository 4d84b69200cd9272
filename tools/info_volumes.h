#pragma once

#include <filesystem>

#include <isobrick/selection.h>
#include <isobrick/storage.h>
#include "tools/console.h"

namespace isobrick::tools {

/// Of an image with several volumes of which the selection does not choose one: writes what all
/// of them share, and how to choose. Returns false of any other.
bool list_volumes(const std::filesystem::path& path, const Storage& storage,
                  const Selection& selection, Console& console);

}  // namespace isobrick::tools
