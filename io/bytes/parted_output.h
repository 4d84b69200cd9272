#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "io/bytes/leftovers.h"
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// A file and, where it needs them, parts in a folder beside it, `path`.parts: written under
/// temporary names and moved to their places together.
///
/// The file names the folder of its parts, so the rename of the file alone makes the output
/// another one. New parts never take the folder of old ones, but `path`.parts-2 and so on; the
/// old ones go when nothing names them any more.
class PartedOutput {
 public:
  /// As OutputFile. Folders of parts are replaced only with `force`, or when a killed process left
  /// them without their file, and only when everything in them has the name of a part: otherwise
  /// UsageError.
  PartedOutput(std::string path, bool force);
  ~PartedOutput();
  PartedOutput(const PartedOutput&) = delete;
  PartedOutput& operator=(const PartedOutput&) = delete;

  /// The file itself.
  OutputFile& index() { return index_; }
  const OutputFile& index() const { return index_; }

  /// Creates a part, which is_part_name() is true of. It must be flushed before publish(). Throws
  /// UsageError on standard output, which takes one file.
  FileWriter create_part(const std::string& name);
  /// The folder of the parts until publish(), made where there is none yet: for other processes,
  /// with create_part_file(). Throws as create_part().
  const std::string& parts_folder();
  /// How the file names a part, relative to its own folder: head.pvtp.parts/part_0.vtp.
  std::string reference(std::string_view name) const;

  /// Moves the folder and then the file to their places. Removes the folders of
  /// an earlier output even if this one has no parts.
  void publish();

 private:
  std::vector<std::filesystem::path> earlier_;  ///< folders of parts that are there
  std::filesystem::path folder_;                ///< where the parts will be
  OutputFile index_;
  Temporary temporary_;  ///< the folder while it is written; without a path when there is none
};

/// Creates a part in a folder that another process has made by parts_folder(). Throws Error.
FileWriter create_part_file(const std::filesystem::path& folder, const std::string& name);

/// The folders of parts that are beside `path`.
std::vector<std::filesystem::path> part_folders(const std::filesystem::path& path);

}  // namespace isobrick
