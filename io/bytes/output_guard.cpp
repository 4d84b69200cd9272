#include "io/bytes/output_guard.h"

#include <fmt/format.h>

#include <string_view>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Whether `path` is `folder` or lies in it; both exist.
bool lies_in(const fs::path& path, const fs::path& folder) {
  std::error_code failure;
  for (fs::path above = fs::canonical(path, failure); !failure; above = above.parent_path()) {
    if (fs::equivalent(above, folder, failure)) return true;
    if (!above.has_relative_path()) return false;
  }
  return false;
}

[[noreturn]] void refuse(const fs::path& output, std::string_view why) {
  throw UsageError(fmt::format("'{}' is not replaced: {}", output.string(), why));
}

}  // namespace

void check_replaces_no_input(const fs::path& output, std::span<const fs::path> inputs) {
  std::error_code none;
  if (!fs::exists(output, none)) return;
  for (const fs::path& input : inputs) {
    if (!fs::exists(input, none)) continue;
    if (fs::equivalent(input, output, none)) refuse(output, "it is the input");
    if (!fs::is_directory(output, none) && lies_in(output, input))
      refuse(output, fmt::format("it is a part of the input '{}'", input.string()));
    if (lies_in(input, output))
      refuse(output, fmt::format("the input '{}' lies in it", input.string()));
  }
  if (const fs::path current = fs::current_path(none); !none && lies_in(current, output))
    refuse(output, "the current directory lies in it");
}

}  // namespace isobrick
