#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include <isobrick/volume_request.h>

// Names of outputs: none may have the extension of another format.
namespace isobrick::tools {

/// Whether an output goes to standard output instead of a file.
inline bool is_standard_output(std::string_view path) { return path == "-"; }

/// Throws UsageError where the extension of `path` belongs to a format that is known and not among
/// `own` (".ply"); `instead` ends the message.
void refuse_misleading_name(const std::string& path, std::span<const std::string_view> own,
                            std::string_view instead);

/// Refuses the URL of an output, which the file layer would take for a path.
void refuse_url_output(const std::string& path);

/// Throws UsageError for a picture that is neither named .png, nor without extension, nor on
/// standard output.
void check_picture_name(const std::string& path);

/// Throws UsageError for a store that is named as a file of a known format, or `-`.
void check_store_name(const std::string& path);

/// Throws UsageError where an output exists and `force` is not set, Error where its folder does not
/// exist. Standard output can always be written.
void check_can_write(const std::filesystem::path& path, bool force);

/// What outputs of an input are called where no name is given: volume_stem() and, of several
/// volumes in it, the one that is chosen: "run_data_t" of run.h5:/data/t, "x_density" of a grid,
/// "x_c1_t3" of a channel and a time. Throws UsageError for standard input, which has no name.
std::string stem_of_input(const std::string& path, const VolumeRequest& request = {});

}  // namespace isobrick::tools
