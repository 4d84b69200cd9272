#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "io/bytes/file.h"

// Outputs grow under names such as mesh.ply.partial-4711-0-5a9c01ef. A process holds a lock on what
// it writes so, and the lock ends with the process: what is not locked is what a killed one left.

namespace isobrick::inline v0 {

/// A file or folder under such a name, locked as long as `fd` is open.
struct Temporary {
  UniqueFd fd;
  std::string path;
};

/// The folder of temporary files, $TMPDIR or /tmp. Throws Error where it is none.
std::filesystem::path temporary_folder();

/// Creates a file that only this call can have made. Throws Error.
Temporary create_temporary_file(const std::string& path);
Temporary create_temporary_folder(const std::string& path);

/// Removes the temporary files that killed processes left of the output `path`; whether there
/// were any. Folders are removed if they hold nothing but parts (is_part_name), with
/// `whole_folders` whatever they hold.
bool remove_leftovers(const std::string& path, bool whole_folders = false);

/// Whether a file name is such a name of the output `output`, without folders.
bool is_temporary_of(std::string_view name, std::string_view output);

/// Held while an output takes its final name. Throws Cancelled when an end was requested
/// (core/cancel.h). One thread may hold several.
class Publication {
 public:
  Publication();
  ~Publication();
  Publication(const Publication&) = delete;
  Publication& operator=(const Publication&) = delete;
};

/// For a process that ends without its destructors: removes what it created under temporary names
/// and has not published, and lets no publication begin any more.
void remove_unfinished() noexcept;

/// Names of parts of an output in several files: part_3.vtp, part_3_1.vtp for what a further cut
/// made of the third. `extension` with its dot.
std::string part_name(std::uint64_t number, std::uint32_t cut, std::string_view extension);
/// Whether a file has such a name.
bool is_part_name(std::string_view name);

}  // namespace isobrick
