#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "isobrick/io/output_file.h"

namespace isobrick {

/// A file and, where it needs them, parts in a folder beside it, `path`.parts:
/// written under temporary names and moved to their places together.
///
/// Each of the two moves is one step; between them lies an instant in which
/// the folder is new and the file is not.
class PartedOutput {
 public:
  /// As OutputFile. The folder is replaced only with `force`, and only when
  /// everything in it has the name of a part: otherwise UsageError.
  PartedOutput(std::string path, bool force);
  ~PartedOutput();
  PartedOutput(const PartedOutput&) = delete;
  PartedOutput& operator=(const PartedOutput&) = delete;

  /// The file itself.
  OutputFile& index() { return index_; }
  const OutputFile& index() const { return index_; }

  /// Creates the next part; `extension` with its dot. It must be flushed before publish().
  FileWriter create_part(std::string_view extension);
  std::size_t parts() const { return parts_; }
  /// How the file names a part, relative to its own folder: head.pvtp.parts/part_0.vtp.
  std::string reference(std::size_t part, std::string_view extension) const;

  /// Moves the folder and then the file to their places. Removes the folder of
  /// an earlier output even if this one has no parts.
  void publish();

 private:
  std::filesystem::path folder_;
  bool replaces_;  ///< there is a folder at its place
  OutputFile index_;
  std::filesystem::path temporary_;  ///< the folder while it is written, or the one replaced
  std::size_t parts_ = 0;
};

}  // namespace isobrick
