#include "io/bytes/parted_output.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <cerrno>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_guard.h"
#include "io/bytes/rename.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// path.parts, path.parts-2, path.parts-3 and so on.
fs::path part_folder(const fs::path& path, int number) {
  return path.string() + ".parts" + (number == 1 ? "" : fmt::format("-{}", number));
}

/// Throws when the folder must stay.
void check_folder(const fs::path& folder, bool replace) {
  if (!replace)
    throw UsageError(
        fmt::format("'{}' exists already; add --force to replace it", folder.string()));
  if (fs::symlink_status(folder).type() != fs::file_type::directory)
    throw UsageError(fmt::format("'{}' is no folder of parts", folder.string()));
  for (const FolderEntry& entry : folder_entries(folder))
    if (entry.type != fs::file_type::regular || !is_part_name(entry.name))
      throw UsageError(fmt::format("'{}' holds '{}', which is no part of a mesh; move it away",
                                   folder.string(), entry.name));
  check_replaces_no_input(folder, {});
}

/// The folders that will be removed when the output is whole; throws when one must stay.
std::vector<fs::path> earlier_folders(const std::string& path, bool force) {
  if (path == kStandardOutput) return {};
  const bool killed = remove_leftovers(path);
  remove_leftovers(part_folder(path, 1).string());
  std::vector<fs::path> folders = part_folders(path);
  // A process that was killed between its two moves leaves a folder and no file.
  const bool left = killed && !is_there(path);
  for (const fs::path& folder : folders) check_folder(folder, force || left);
  if (!left) return folders;
  for (const fs::path& folder : folders) fs::remove_all(folder);
  return {};
}

fs::path free_folder(const fs::path& path) {
  int number = 1;
  while (is_there(part_folder(path, number))) ++number;
  return part_folder(path, number);
}

/// `shown` is for messages.
File create_file(const fs::path& path, const fs::path& shown) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error("create", path.string(), errno);
  return {std::move(fd), shown};
}

}  // namespace

PartedOutput::PartedOutput(std::string path, bool force)
    : earlier_(earlier_folders(path, force)),
      folder_(free_folder(path)),
      index_(std::move(path), force, Streaming::when_complete) {}

PartedOutput::~PartedOutput() {
  std::error_code ignored;
  if (!temporary_.path.empty()) fs::remove_all(temporary_.path, ignored);
}

const std::string& PartedOutput::parts_folder() {
  if (index_.path() == kStandardOutput)
    throw UsageError(
        "the mesh needs several files, which standard output cannot take; name a file, or choose "
        "the format PLY");
  if (temporary_.path.empty())
    temporary_ = create_temporary_folder(part_folder(index_.path(), 1).string());
  return temporary_.path;
}

FileWriter PartedOutput::create_part(const std::string& name) {
  return FileWriter(create_file(fs::path(parts_folder()) / name, folder_ / name));
}

std::string PartedOutput::reference(std::string_view name) const {
  return fmt::format("{}/{}", folder_.filename().string(), name);
}

void PartedOutput::publish() {
  if (index_.path() == kStandardOutput) return index_.publish();
  const Publication turn;
  if (!temporary_.path.empty()) {
    if (const int failure = rename_no_replace(temporary_.path, folder_); failure != 0)
      throw system_error("rename the finished folder to", folder_.string(), failure);
    temporary_.path = folder_;  // goes with the file if that cannot be published
  }
  index_.publish();
  temporary_.path.clear();
  std::error_code ignored;  // the output is whole; the next one of its name tries again
  for (const fs::path& folder : earlier_) fs::remove_all(folder, ignored);
}

FileWriter create_part_file(const fs::path& folder, const std::string& name) {
  return FileWriter(create_file(folder / name, folder / name));
}

std::vector<fs::path> part_folders(const fs::path& path) {
  std::vector<fs::path> folders;
  for (int number = 1; number < 10; ++number)
    if (fs::path folder = part_folder(path, number); is_there(folder))
      folders.push_back(std::move(folder));
  return folders;
}

}  // namespace isobrick
