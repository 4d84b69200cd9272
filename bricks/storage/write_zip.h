#pragma once

#include <functional>
#include <string>

#include <isobrick/progress.h>
#include <isobrick/storage.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// As the public write_zip(), of the keys that `wanted` accepts, into an output that the caller
/// publishes.
void write_zip(const Storage& storage, const std::function<bool(const std::string& key)>& wanted,
               FileWriter& out, Progress& progress);

}  // namespace isobrick
