#pragma once

#include <filesystem>
#include <span>

namespace isobrick::inline v0 {

/// Throws UsageError when replacing `output` would take away something that the command still
/// needs: `output` is one of its inputs, a file in one (in a store), or a folder that holds an
/// input or the current directory. By whatever names and links; what does not exist is passed over.
void check_replaces_no_input(const std::filesystem::path& output,
                             std::span<const std::filesystem::path> inputs);

}  // namespace isobrick
